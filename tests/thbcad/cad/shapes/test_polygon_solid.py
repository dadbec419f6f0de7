"""Polygon outlines: volumes against closed forms and OCCT, exact rims, solids that keep every pole."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import BSpline

from tests.cases import examples
from tests.thbcad import cases as strategies
from tests.thbcad.cad.shapes.cases import CASES, assert_sound, rough
from thbcad.cad.exchange import part_step, read_step, solid_volume
from thbcad.cad.shapes import polygon_part
from thbcad.io import brep_of_text, image_distance, turned_faces, volume
from thbcad.lens import FreeformSurface, Lens, Product, optical_forms, polygon_volume
from thbcad.outlines import DEGREE, Line, Polygon, integral_within, rim_curve
from thbcad.sags import Conic, PlacedConic
from thbcad.splines import BSplineSurface

HEXAGON = [(3.5 * np.cos(t), 3.5 * np.sin(t)) for t in np.pi / 3 * np.arange(6)]
OUTLINES = {
    "hexagon": HEXAGON,
    "triangle clockwise": [(-3.0, -2.5), (0.5, 3.7), (3.0, -1.0)],
    "L": [(-3, -3), (3, -3), (3, 0), (0.5, 0), (0.5, 3.5), (-3, 3.5)],
    "arrow": [(-3.0, -2.0), (0.3, -0.9), (3.1, -2.2), (0.1, 3.3)],
}
SOLIDS = [(case, outline) for case in CASES for outline in ("hexagon", "arrow")]
SOLIDS += [("round", "L"), ("sphere", "triangle clockwise")]


def corners_within(lens, name):
    """The corners of an outline, made smaller where a lens is narrower than 3.75 mm."""
    fit = min(1.0, *(half / 3.75 for f in (lens.front, lens.rear) for half in f.half_width))
    return np.array(OUTLINES[name]) * fit


@pytest.fixture(scope="module", params=SOLIDS, ids=" ".join)
def written(request, tmp_path_factory):
    """(lens, corners, part, text, what was read back), written once for each case."""
    lens = CASES[request.param[0]][0]
    corners = corners_within(lens, request.param[1])
    part = polygon_part(lens, corners)
    path = tmp_path_factory.mktemp("polygon") / "lens.step"
    path.write_bytes(part_step(part, Product()))
    return lens, corners, part, brep_of_text(path.read_text()), read_step(path)


@pytest.mark.every(4)
def test_the_solid_is_closed_and_keeps_every_pole(written):
    lens, corners, part, text, read = written
    assert_sound(lens, part, read, 2 + len(corners))
    assert tuple(part.names) == ("front", "rear", *(f"edge {k + 1}" for k in range(len(corners))))
    assert {face.surface_type for face in text.faces if face.name.startswith("edge")} == {"PLANE"}


def has_curved_conic(lens):
    """Whether a face is a sphere or a patch: rims and images there are within 1e-9 mm."""
    return any(isinstance(form, PlacedConic) and form.kind != "PLANE" for form in optical_forms(lens))


@pytest.mark.every(4)
def test_edges_lie_on_their_faces(written):
    lens, *_, text, _ = written
    distance, left = image_distance(text)
    assert distance <= (2e-9 if has_curved_conic(lens) else 1e-12)
    assert left == ()
    assert turned_faces(text) == 0


@pytest.mark.every(3)
def test_volumes_agree(written):
    """Over the lens's graphs, over the text of the file, and by OCCT as built."""
    lens, corners, part, text, _ = written
    wanted = polygon_volume(lens, corners)
    assert volume(text) == pytest.approx(wanted, rel=1e-10 if has_curved_conic(lens) else 1e-12)
    assert solid_volume(part.solid, 1e-10) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("name", OUTLINES)
def test_a_prism_under_a_paraboloid(name):
    """The integral of x^2 + y^2 over a triangle (0, a, b) is |a x b| / 12 (a.a + a.b + b.b)."""
    lens = Lens(FreeformSurface((5, 6)), FreeformSurface((5, 6), Conic(25.0, -1.0)), 3.0, 1.5)
    polygon = Polygon(OUTLINES[name])
    a, b = np.moveaxis(polygon.sides, 1, 0)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    square = (cross / 12 * ((a * a) + (a * b) + (b * b)).sum(axis=1)).sum()
    wanted = 3.0 * cross.sum() / 2 + square / 50
    assert polygon_volume(lens, OUTLINES[name]) == pytest.approx(wanted, rel=1e-13)
    assert polygon_volume(lens, OUTLINES[name][::-1]) == pytest.approx(wanted, rel=1e-13)


def test_a_rectangle_is_the_whole_lens():
    lens = Lens(FreeformSurface((5, 4), sag=rough()), FreeformSurface((5, 4), sag=rough(seed=2)), 3.0, 1.5)
    corners = [(-5, -4), (5, -4), (5, 4), (-5, 4)]
    assert polygon_volume(lens, corners) == pytest.approx(lens.volume(), rel=1e-13)


@pytest.mark.parametrize(
    ("start", "stop", "degree"),
    [((-4, -3), (3.5, 2.0), 6), ((-4, 1), (4, 1), 3), ((2, 3), (2, -3), 3), ((1, 1), (1.5, 4), 6)],
)
def test_a_rim_above_a_straight_side_is_exact(start, stop, degree):
    graph = FreeformSurface((5, 4), Conic(30.0, -1.0), rough(amplitude=1.0)).graph((3, 3))
    kv, poles = rim_curve(graph, Line(start, stop))
    t = np.linspace(0, 1, 2001)
    x, y = (np.array(start) + t[:, None] * np.subtract(stop, start)).T
    assert kv.degree == degree
    assert abs(BSpline(kv.knots, poles, degree)(t) - np.column_stack([x, y, graph(x, y)])).max() <= 1e-13


def test_a_rim_of_a_high_degree_is_fitted():
    """Degrees 6 and 5 would make 11, which CAD files do not hold."""
    graph = FreeformSurface((5, 4), Conic(30.0, -1.0), rough((6, 5), (3, 3))).graph((6, 5))
    side = Line((-4.0, -3.0), (3.5, 2.0))
    kv, poles = rim_curve(graph, side)
    t = np.linspace(0, 1, 2001)
    x, y = side(t)
    assert kv.degree == DEGREE
    assert abs(BSpline(kv.knots, poles, DEGREE)(t) - np.column_stack([x, y, graph(x, y)])).max() <= 2e-9


@examples(25)
@given(strategies.seeds(), st.integers(4, 9))
def test_the_integral_over_a_polygon_is_that_over_its_parts(rng, count):
    """A convex polygon and both sides of a chord of it, over a rough spline."""
    kvs = [strategies.random_knot_vector(rng, 3, 5).rescale(-5.0, 5.0) for _ in range(2)]
    graph = BSplineSurface(*kvs, rng.uniform(-1, 1, [kv.dim for kv in kvs]))
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(0, 0.8, count)) / count
    corners = np.column_stack([4.9 * np.cos(angles), 3.0 * np.sin(angles)])
    parts = corners[:3], np.vstack([corners[2:], corners[:1]])
    whole, *pieces = (integral_within(graph, Polygon(rows).pieces) for rows in (corners, *parts))
    assert whole == pytest.approx(sum(pieces), abs=1e-12)


def meet(a, b, c, d):
    """Whether the segments ab and cd have a point in common, by whole numbers."""

    def turn(p, q, r):
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    def on(p, q, r):
        return turn(p, q, r) == 0 and all(min(p[k], q[k]) <= r[k] <= max(p[k], q[k]) for k in (0, 1))

    across = turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0
    return across or on(a, b, c) or on(a, b, d) or on(c, d, a) or on(c, d, b)


def simple(corners):
    """Whether sides meet nowhere but neighbours in their corner."""
    count = len(corners)
    sides = [(corners[k], corners[(k + 1) % count]) for k in range(count)]
    if any(a == b for a, b in sides):
        return False
    apart = (
        (i, j) for i in range(count) for j in range(i + 1, count) if (j - i) % count not in (1, count - 1)
    )
    folded = any(
        meet(a, a, *after) or meet(c, c, a, b)
        for (a, b), after in zip(sides, [*sides[1:], sides[0]])
        for c in [after[1]]
    )
    return not folded and not any(meet(*sides[i], *sides[j]) for i, j in apart)


@examples(200)
@given(st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=3, max_size=7))
def test_polygons_are_refused_where_sides_meet(corners):
    """On a grid, where whole numbers decide."""
    try:
        polygon = Polygon(corners)
    except ValueError:
        assert not simple(corners)
    else:
        assert simple(corners)
        assert polygon.area > 0


@pytest.mark.parametrize(
    ("corners", "sentence"),
    [
        ([(0, 0), (1, 0)], "3 to 1000 corners"),
        ("abc", "3 to 1000 corners"),
        ([(0, 0), (1, 0), (np.nan, 1)], r"finite numbers up to 1e\+06 mm, got"),
        (np.ma.masked_array([(0, 0), (1, 0), (0, 1)], mask=[[0, 0], [1, 0], [0, 0]]), "finite numbers up to"),
        ([(0, 0), (1, 0), (1, 0), (0, 1)], "corners 2 and 3 of the polygon must lie apart"),
        ([(0, 0), (2, 2), (2, 0), (0, 2)], "must not touch or cross itself"),
        ([(0, 0), (2, 0), (2, 2), (1, 0), (0, 2)], "must not touch or cross itself"),
        ([(0, 0), (2, 0), (1, 0)], "must not touch or cross itself"),
        ([(0, 0), (9, 0), (0, 1)], "within the front's half-widths"),
    ],
)
def test_refusals(corners, sentence):
    lens = Lens(FreeformSurface((5, 4)), FreeformSurface((5, 4)), 3.0, 1.5)
    with pytest.raises(ValueError, match=sentence):
        polygon_part(lens, corners)
