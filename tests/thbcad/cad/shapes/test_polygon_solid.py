"""Polygon outlines: volumes against closed forms and OCCT, exact rims, solids that keep every pole."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from tests.thbcad.cad.shapes.cases import CASES, rough, same_bits
from thbcad.cad.exchange import part_step, read_step, solid_volume
from thbcad.cad.shapes import polygon_part
from thbcad.io import brep_of_text, image_distance, turned_faces, volume
from thbcad.lens import (
    FreeformSurface,
    Lens,
    Polygon,
    Product,
    optical_forms,
    polygon_volume,
    side_curve,
)
from thbcad.sags import Conic, PlacedConic

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


def test_the_solid_is_closed_and_precise(written):
    _, corners, part, text, read = written
    assert (read.solids, read.faces, read.free_edges, read.closed, read.valid) == (
        1,
        2 + len(corners),
        0,
        True,
        True,
    )
    assert read.tolerance <= 1e-7
    names = ("front", "rear", *(f"edge {k + 1}" for k in range(len(corners))))
    assert tuple(part.names) == tuple(read.face_names) == names
    assert {face.surface_type for face in text.faces if face.name.startswith("edge")} == {"PLANE"}


def test_front_and_rear_keep_every_pole(written):
    lens, _, _, _, read = written
    for found, wanted in zip((read.front, read.rear), optical_forms(lens), strict=True):
        assert same_bits(found, wanted)


def has_curved_conic(lens):
    """Whether a face is a sphere or a patch: rims and images there are within 1e-9 mm."""
    return any(isinstance(form, PlacedConic) and form.kind != "PLANE" for form in optical_forms(lens))


def test_edges_lie_on_their_faces(written):
    lens, *_, text, _ = written
    distance, left = image_distance(text)
    assert distance <= (2e-9 if has_curved_conic(lens) else 1e-12)
    assert left == ()
    assert turned_faces(text) == 0


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
    kv, poles = side_curve(graph, np.array(start, dtype=float), np.array(stop, dtype=float))
    t = np.linspace(0, 1, 2001)
    x, y = (np.array(start) + t[:, None] * np.subtract(stop, start)).T
    assert kv.degree == degree
    assert abs(BSpline(kv.knots, poles, degree)(t) - np.column_stack([x, y, graph(x, y)])).max() <= 1e-13


@pytest.mark.parametrize(
    ("corners", "sentence"),
    [
        ([(0, 0), (1, 0)], "3 to 1000 corners"),
        ("abc", "3 to 1000 corners"),
        ([(0, 0), (1, 0), (np.nan, 1)], "finite numbers in mm, got"),
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
