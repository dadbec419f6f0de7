"""The elliptic aperture: volumes against closed forms, rims on their surfaces, solids that read back closed
with every pole."""

from itertools import pairwise
from math import gamma

import build123d
import numpy as np
import pytest
from hypothesis import given, strategies as st
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_Line
from scipy.integrate import quad
from scipy.interpolate import BSpline

from tests.thbcad import cases as strategies
from tests.thbcad.cad.shapes.cases import CASES, assert_sound
from thbcad.cad.exchange import part_step, read_step, solid_volume
from thbcad.cad.shapes import trimmed_part
from thbcad.lens import FreeformSurface, Lens, Product, aperture_volume, optical_forms
from thbcad.outlines import DEGREE, TOLERANCE, Arc, Outline, integral_within, kinks, rim_curve
from thbcad.sags import Conic, PlacedConic
from thbcad.splines import BSplineSurface, KnotVector, interpolate

BETWEEN = (
    2 * TOLERANCE
)  # a rim is held at eight places in every span; between them the error of degree 5 is less than twice that

GEOM_TYPES = {
    "PLANE": build123d.GeomType.PLANE,
    "SPHERE": build123d.GeomType.SPHERE,
    "QUADRIC": build123d.GeomType.BSPLINE,
    "BSPLINE": build123d.GeomType.BSPLINE,
}


@pytest.fixture(scope="module", params=CASES)
def written(request, tmp_path_factory):
    """(lens, semi-axes, part, path, what was read back), written once for each case."""
    lens, semi_axes = CASES[request.param]
    part = trimmed_part(lens, semi_axes)
    path = tmp_path_factory.mktemp("aperture") / "lens.step"
    path.write_bytes(part_step(part, Product()))
    return lens, semi_axes, part, path, read_step(path)


def semi_axes():
    """Semi-axes on both sides of a circle, and circles."""
    sizes = st.floats(0.1, 5.0)
    return st.one_of(st.tuples(sizes, sizes), sizes.map(lambda a: (a, a)))


# ---- volumes ----


@given(st.integers(2, 10), st.integers(2, 10), st.data())
def test_moments_of_the_ellipse(p, q, data):
    """Integral of x^i y^j = a^(i+1) b^(j+1) / (i + j + 2) times that of cos^i sin^j, in closed form."""
    i, j = data.draw(st.integers(0, p)), data.draw(st.integers(0, q))
    a, b = data.draw(semi_axes())
    kvs = [KnotVector.uniform(degree, data.draw(st.integers(1, 5)), -5.0, 5.0) for degree in (p, q)]
    graph = interpolate(*kvs, lambda x, y: (x / a) ** i * (y / b) ** j)
    turn = (
        2 * gamma((i + 1) / 2) * gamma((j + 1) / 2) / gamma((i + j) / 2 + 1) if i % 2 == j % 2 == 0 else 0.0
    )
    # rounding of the coefficients counts against the integral of the greatest one
    scale = a * b * max(abs(graph.coefficients).max(), 1.0)
    assert integral_within(graph, Outline.ellipse((a, b)).pieces) == pytest.approx(
        a * b * turn / (i + j + 2), abs=1e-13 * scale
    )


@given(st.tuples(*[st.sampled_from([np.inf, 40.0, -33.0, 150.0])] * 2), semi_axes())
def test_volume_between_paraboloids(radii, axes):
    """pi a b (thickness + (1 / 2R_rear - 1 / 2R_front) (a^2 + b^2) / 4)."""
    a, b = axes
    lens = Lens(*(FreeformSurface(h, Conic(r, -1.0)) for h, r in zip(((5, 6), (7, 5)), radii)), 9.0, 1.5)
    bend = sum(sign / (2 * r) for sign, r in zip((-1, 1), radii))
    assert aperture_volume(lens, axes) == pytest.approx(
        np.pi * a * b * (9.0 + bend * (a * a + b * b) / 4), rel=1e-13
    )


@pytest.mark.parametrize("name", ["round", "upright", "rear smaller"])
def test_volume_of_rough_surfaces_against_scipy(name):
    """Slices x = a sin w of the ellipse: exact integrals of scipy's splines over y, adaptive quadrature over
    w."""
    lens, (a, b) = CASES[name]
    total = 0.0
    for sign, graph in zip((-1, 1), lens.graphs()):

        def slice_area(w, graph=graph):
            row = BSpline(graph.kv_u.knots, graph.coefficients, graph.kv_u.degree)(a * np.sin(w))
            edge = b * np.cos(w)
            return (
                a
                * np.cos(w)
                * float(BSpline(graph.kv_v.knots, row, graph.kv_v.degree).integrate(-edge, edge))
            )

        whole = Arc((a, b), (0.0, 2 * np.pi), b > a)
        angles, _ = whole.crossings(graph.kv_u.breaks, graph.kv_v.breaks)
        x, _ = whole(angles)
        places = np.unique(np.r_[-np.pi / 2, np.arcsin(np.clip(x / a, -1, 1)), np.pi / 2])
        total += sign * sum(
            quad(slice_area, *pair, epsabs=1e-12)[0] for pair in pairwise(places) if pair[1] - pair[0] > 1e-9
        )
    assert aperture_volume(lens, (a, b)) == pytest.approx(np.pi * a * b * lens.thickness + total, rel=1e-11)


# ---- rims ----


@given(semi_axes(), strategies.knot_vectors(max_degree=3, scales=(0.1,)))
def test_crossings_lie_on_the_lines(axes, kv):
    ellipse, x, y = Arc(axes, (0.0, 2 * np.pi), axes[1] > axes[0]), kv.breaks, kv.breaks[::-1] / 2
    angles, lines = ellipse.crossings(x, y)
    places = np.where(lines < len(x), *ellipse(angles))
    assert places == pytest.approx(np.r_[x, y][lines], abs=1e-14 * max(axes))
    assert len(angles) == 2 * ((abs(x) <= axes[0]).sum() + (abs(y) <= axes[1]).sum())
    assert ((angles >= 0) & (angles <= 2 * np.pi)).all()


@given(strategies.seeds(), semi_axes(), st.integers(2, 6))
def test_rims_lie_on_rough_graphs(rng, axes, degree):
    """Densely sampled, creases (knots of full multiplicity) included."""
    kvs = [strategies.random_knot_vector(rng, degree, 5).rescale(-5.0, 5.0) for _ in range(2)]
    graph = BSplineSurface(*kvs, 0.1 * rng.uniform(-1, 1, [kv.dim for kv in kvs]))
    for half in Outline.ellipse(axes).pieces:
        kv, poles = rim_curve(graph, half)
        t = np.linspace(kv.start, kv.stop, 4001)
        x, y = (np.clip(row, -5, 5) for row in half(t))
        assert (
            abs(BSpline(kv.knots, poles, DEGREE)(t) - np.column_stack([x, y, graph(x, y)])).max() <= BETWEEN
        )


def test_a_rim_is_as_smooth_as_its_surface():
    kv = KnotVector(3, [0, 0, 0, 0, 1, 2, 2, 3, 3, 3, 4, 4, 4, 4])
    values, counts = kinks(kv)
    assert values.tolist() == [1, 2, 3]
    assert (DEGREE - counts).tolist() == [2, 1, 0]  # continuous derivatives


# ---- solids ----


def test_the_solid_is_closed_and_keeps_every_pole(written):
    lens, _, part, _, read = written
    assert_sound(lens, part, read, 4)
    assert tuple(part.names) == ("front", "rear", "edge 1", "edge 2")


@pytest.mark.every(3)
def test_volumes_agree(written):
    """As built and as read; the signed volume of the raw solid also tells that all normals point outward."""
    lens, semi_axes, part, _, read = written
    wanted = aperture_volume(lens, semi_axes)
    assert solid_volume(part.solid, 1e-6) == pytest.approx(wanted, rel=1e-6)
    assert solid_volume(read.shape, 1e-6) == pytest.approx(wanted, rel=1e-6)


def test_rims_in_the_file_lie_on_the_cylinder_and_on_the_surfaces(written):
    """Read by build123d; the two halves of the edge are plain cylinders or extrusions."""
    lens, (a, b), _, path, _ = written
    solid = build123d.import_step(path).solids()[0]
    assert solid.is_valid
    kinds = {face.geom_type for face in solid.faces()}
    forms = [form.kind if isinstance(form, PlacedConic) else "BSPLINE" for form in optical_forms(lens)]
    assert kinds == {
        *(GEOM_TYPES[kind] for kind in forms),
        build123d.GeomType.CYLINDER if a == b else build123d.GeomType.EXTRUSION,
    }
    rims = []
    for edge in solid.edges():
        first, last = BRep_Tool.Range_s(edge.wrapped)
        curve = BRep_Tool.Curve_s(edge.wrapped, 0.0, 1.0)
        if not isinstance(curve, Geom_Line):
            rims.append(np.array([curve.Value(t).Coord() for t in np.linspace(first, last, 501).tolist()]))
    assert len(rims) == 4
    for rim in rims:
        x, y, z = rim.T
        ellipse = np.hypot(x / a, y / b)
        assert abs(ellipse - 1).max() * max(a, b) <= BETWEEN
        x, y = x / ellipse, y / ellipse
        low, high = abs(z - lens.front(x, y)).max(), abs(z - lens.thickness - lens.rear(x, y)).max()
        # beside the rim's own error: a slope below 1 times its sideways error, 1e-11 mm of interpolated
        # conics
        assert min(low, high) <= 2 * BETWEEN


@pytest.mark.parametrize(
    ("semi_axes", "message"),
    [
        ((7.0, 9.0), r"at most the front's half-widths \(8.0, 8.0\) mm, got \(7.0, 9.0\)"),
        ((7.0, 7.0), r"at most the rear's half-widths \(6.0, 9.0\) mm"),
        ((0.0, 7.0), r"semi_axes must be two positive numbers, got \(0.0, 7.0\)"),
        ((np.nan, 7.0), "semi_axes must be two positive numbers"),
        (7.0, "semi_axes must be two positive numbers, got 7.0"),
    ],
)
def test_refusals(semi_axes, message):
    lens = Lens(FreeformSurface((8, 8)), FreeformSurface((6, 9)), 3.0, 1.5)
    for verb in (aperture_volume, trimmed_part):
        with pytest.raises(ValueError, match=message):
            verb(lens, semi_axes)


def test_a_lens_is_needed():
    with pytest.raises(ValueError, match="lens must be a Lens, got str"):
        trimmed_part("lens", (1, 1))
