"""Arcs, conic sections, meridians, revolution and ruled surfaces against closed forms and OCCT."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from OCP.GC import GC_MakeArcOfCircle
from OCP.Geom import Geom_SurfaceOfRevolution
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp, gp_Ax1, gp_Ax2, gp_Circ, gp_Dir, gp_Pnt

from oracles.spline_definitions import gauss
from tests.thbcad.cases import seeds
from tests.thbcad.splines.cases import curves, geom_curve
from thbcad.cad.shapes import spline_surface
from thbcad.sags import Conic, meridian
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.nurbs import NURBSCurve
from thbcad.splines.nurbs_shapes import circular_arc, conic_arc, line, revolved, ruled

EPS = np.finfo(float).eps
U = np.linspace(0, 1, 201)
NODES = 24  # of a span: functions that are analytic there are integrated to rounding
ANGLES = st.floats(-2 * np.pi, 2 * np.pi).filter(lambda a: abs(a) > 1e-3)
RADII = st.floats(0.1, 1e3)
IN_SPACE = np.array([[1.0, 0], [0, 0], [0, 1]])  # (r, z) to (x, 0, z)


@st.composite
def conics(draw):
    """(conic, radius): planes and all kinds, up to 0.99 of the reach of ellipses."""
    curvature, constant = draw(st.floats(-0.1, 0.1)), draw(st.sampled_from([-1.0, 0.0]) | st.floats(-5, 5))
    radius = np.inf if abs(curvature) < 1e-3 else 1 / curvature
    reach = abs(radius) / np.sqrt(1 + constant) if constant > -1 else np.inf
    return Conic(radius, constant), min(25.0, draw(st.floats(0.01, 0.99)) * min(reach, 1e9))


def length(curve):
    u, w = gauss(curve.kv.breaks, NODES)
    return w @ np.linalg.norm(curve(u, 1), axis=1)


def area(surface):
    (u, a), (v, b) = (gauss(kv.breaks, NODES) for kv in surface.knot_vectors)
    return a @ np.linalg.norm(np.cross(surface.grid(u, v, (1, 0)), surface.grid(u, v, (0, 1))), axis=2) @ b


# ---- arcs ----


@given(RADII, ANGLES, st.floats(-7, 7))
def test_arcs_lie_on_the_circle_and_run_from_start_to_stop(radius, angle, start):
    arc = circular_arc(radius, angle, start)
    x, y = arc(U).T
    # some ten roundings in points, weights and basis
    assert abs(np.hypot(x, y) - radius).max() <= 10 * EPS * radius
    turned = np.unwrap(np.arctan2(y, x))
    turned -= turned[0]
    assert (np.diff(turned) * np.sign(angle) > 0).all()
    assert turned[-1] == pytest.approx(angle, abs=1e-14)
    assert arc.coefficients[0] == pytest.approx(
        radius * np.array([np.cos(start), np.sin(start)]), abs=EPS * radius
    )
    assert length(arc) == pytest.approx(radius * abs(angle), rel=1e-13)


@pytest.mark.parametrize(
    ("angle", "spans"),
    [(2, 1), (2 * np.pi / 3, 1), (2.2, 2), (-np.pi, 2), (4 * np.pi / 3, 2), (4.3, 3), (2 * np.pi, 3)],
)
def test_arcs_have_the_fewest_segments_of_120_degrees(angle, spans):
    arc = circular_arc(2.0, angle)
    assert (arc.kv.degree, arc.kv.spans, arc.kv.dim) == (2, spans, 2 * spans + 1)
    assert arc.weights.min() >= 0.5


@given(RADII, st.floats(-7, 7))
def test_whole_circles_are_closed(radius, start):
    for turn in (2 * np.pi, -2 * np.pi):
        circle = circular_arc(radius, turn, start, centre=(3.0, -4.0))
        assert (circle.coefficients[0] == circle.coefficients[-1]).all()
        assert abs(np.hypot(*(circle(U) - [3.0, -4.0]).T) - radius).max() <= 10 * EPS * (radius + 5)


def test_arcs_are_smooth_where_segments_meet():
    """The directions on both sides of a double knot agree: the curve has a tangent, the parametrisation has
    none."""
    arc = circular_arc(1.0)
    for knot in arc.kv.breaks[1:-1]:
        left, right = (arc.segment(ends) for ends in ((0.0, knot), (knot, 1.0)))
        a, b = left([knot], 1)[0], right([knot], 1)[0]
        assert abs(a[0] * b[1] - a[1] * b[0]) <= 20 * EPS * np.linalg.norm(a) * np.linalg.norm(b)
        assert a @ b > 0


@given(RADII, st.floats(0.01, 6.2), st.floats(0, 6.2))
def test_arcs_against_occt(radius, angle, start):
    """OCCT's arc as B-spline has the same ends; other segments, hence other knots."""
    circle = gp_Circ(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), radius)
    theirs = GeomConvert.CurveToBSplineCurve_s(GC_MakeArcOfCircle(circle, start, start + angle, True).Value())
    ours = circular_arc(radius, angle, start)
    ends = np.array([theirs.StartPoint().Coord(), theirs.EndPoint().Coord()])[:, :2]
    # the angle start + angle is rounded
    assert abs(ours([0.0, 1.0]) - ends).max() <= 20 * EPS * radius


def test_an_ellipse_is_an_affine_image_of_the_circle():
    x, y = circular_arc(1.0).transform(np.diag([5.0, 2.0]), [1.0, 0.0])(U).T
    assert abs(((x - 1) / 5) ** 2 + (y / 2) ** 2 - 1).max() <= 20 * EPS


@pytest.mark.parametrize("angle", [0.0, 6.3, -7.0, np.nan, None, "a"])
def test_angles_are_refused(angle):
    with pytest.raises(ValueError, match=r"angle must be at most one turn|angle must be a finite number"):
        circular_arc(1.0, angle)
    with pytest.raises(ValueError, match=r"angle must be at most one turn|angle must be a finite number"):
        revolved(line([1, 0], [1, 1]), angle)


@pytest.mark.parametrize("start", [1e3, 1e20, -1e300])
def test_arcs_start_at_any_angle(start):
    """Against the arc from 0, turned by the exact cosine and sine."""
    c, s = np.cos(start), np.sin(start)
    turned = circular_arc(2.0, 2.5).transform([[c, -s], [s, c]])
    assert abs(circular_arc(2.0, 2.5, start)(U) - turned(U)).max() <= 20 * EPS


@pytest.mark.parametrize("start", [np.inf, np.nan, None, "a"])
def test_starts_are_refused(start):
    with pytest.raises(ValueError, match="start must be a finite number"):
        circular_arc(1.0, 1.0, start)


# ---- conic sections ----


@given(st.floats(0.05, 20).filter(lambda w: abs(w - 1) > 0.02) | st.just(1.0), seeds())
def test_the_weight_tells_the_kind_of_the_conic(weight, rng):
    """The conic a x^2 + b x y + c y^2 + ... = 0 through the points: 4 a c - b^2 is positive, zero or
    negative."""
    points = rng.uniform(-1, 1, (3, 2)) + np.array([[0, 0], [3, 3], [6, 0]])
    arc = conic_arc(*points, weight)
    x, y = arc(np.linspace(0, 1, 41)).T
    _, values, rows = np.linalg.svd(np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)], axis=1))
    assert values[-1] <= 1e-12 * values[0]  # one conic holds all points
    a, b, c = rows[-1, :3]
    assert np.sign(np.round((4 * a * c - b * b) / (a * a + b * b + c * c), 6)) == np.sign(1 - weight)


@given(st.floats(0.05, 20), seeds())
def test_conic_arcs_keep_ends_tangents_and_shoulder(weight, rng):
    start, middle, stop = points = rng.uniform(-1, 1, (3, 3))
    arc = conic_arc(*points, weight)
    shoulder = ((start + stop) / 2 + weight * middle) / (1 + weight)
    assert abs(arc([0.0, 0.5, 1.0]) - [start, shoulder, stop]).max() <= 10 * EPS
    assert abs(
        arc([0.0, 1.0], 1) - [2 * weight * (middle - start), 2 * weight * (stop - middle)]
    ).max() <= 40 * EPS * (1 + weight)


def test_a_negative_weight_is_refused():
    with pytest.raises(ValueError, match=r"weights must lie between .*, got -0\.5"):
        conic_arc([0, 0], [1, 1], [2, 0], -0.5)


# ---- meridians of lens conics ----


@given(conics())
def test_meridians_are_the_conic(case):
    """r within 4 roundings; z and slope at that r as the closed form has them.

    The closed form takes s = sqrt(1 - (1 + K) c^2 r^2), whose relative error is some 4 eps (1 + 1 / s^2).
    """
    conic, radius = case
    curve = meridian(conic, radius)
    r, z = curve(U).T
    c = 1 / conic.radius
    s2 = 1 - (1 + conic.constant) * (c * radius) ** 2
    rounding = 20 * EPS * (1 + 1 / s2) * (1 + (1 + abs(1 + conic.constant)) * (c * radius) ** 2)
    assert (r[0], z[0]) == (0, 0)
    assert r[-1] == pytest.approx(radius, rel=2 * EPS)
    assert (np.diff(r) > 0).all()
    assert abs(z - conic(r, 0.0)).max() <= rounding * abs(z).max()
    dr, dz = curve(U, 1).T
    slopes = conic(r, 0.0, (1, 0))
    assert abs(dz / dr - slopes).max() <= 4 * rounding * abs(slopes).max()


def test_one_segment_reaches_the_equator_of_a_sphere():
    curve = meridian(Conic(-5.0, 0.0), 5.0)
    r, z = curve(U).T
    assert curve.kv.spans == 1
    assert curve.coefficients[-1].tolist() == [5, -5]
    assert abs(np.hypot(r, z + 5) - 5).max() <= 10 * EPS * 5
    assert length(curve) == pytest.approx(5 * np.pi / 2, rel=1e-14)


def test_planes_and_paraboloids_are_polynomial():
    for conic in (Conic(), Conic(7.0, -1.0)):
        assert meridian(conic, 3.0).weights.tolist() == [1, 1, 1]


def test_a_radius_beyond_the_conic_is_refused():
    with pytest.raises(ValueError, match=r"ends at r = 5 mm, before r = 5.1 mm"):
        meridian(Conic(10.0, 3.0), 5.1)


# ---- revolution ----


@given(conics())
def test_a_revolved_meridian_is_the_lens_surface(case):
    """z(x, y) and the normal (-z_x, -z_y, 1) of the closed form, over the disk."""
    conic, radius = case
    surface = revolved(meridian(conic, radius))
    u, v = np.linspace(0, 1, 17), np.linspace(0, 1, 25)
    x, y, z = np.moveaxis(surface.grid(u, v), -1, 0)
    c = 1 / conic.radius
    s2 = 1 - (1 + conic.constant) * (c * radius) ** 2
    rounding = 40 * EPS * (1 + 1 / s2) * (1 + (1 + abs(1 + conic.constant)) * (c * radius) ** 2)
    assert abs(np.hypot(x, y)[-1] - radius).max() <= 20 * EPS * radius
    assert abs(z - conic(x, y)).max() <= rounding * abs(z).max()
    n = np.cross(surface.grid(u[1:], v, (1, 0)), surface.grid(u[1:], v, (0, 1)))
    slopes = np.stack([conic(x, y, d)[1:] for d in ((1, 0), (0, 1))], axis=-1)
    assert (n[..., 2] > 0).all()
    assert abs(-n[..., :2] / n[..., 2:] - slopes).max() <= 10 * rounding * max(1, abs(slopes).max())


@pytest.mark.parametrize("angle", [2 * np.pi, -1.0, 3.5])
def test_areas(angle):
    """Cylinder r h, cone r s / 2, spherical cap R h, and torus 2 pi R r, each times the angle."""
    cases = [
        (line([3, 0], [3, 5]), 15.0),
        (line([0, 0], [3, 4]), 7.5),
        (meridian(Conic(10.0), 8.0), 10.0 * 4.0),
        (meridian(Conic(10.0), 10.0), 10.0 * 10.0),
        (circular_arc(1.0, centre=(3.0, 0.0)), 2 * np.pi * 3.0),
    ]
    for curve, per_angle in cases:
        assert area(revolved(curve, angle)) == pytest.approx(abs(angle) * per_angle, rel=1e-13)


def test_a_skew_line_makes_a_hyperboloid():
    x, y, z = np.moveaxis(revolved(line([2, -3, -1], [2, 3, 1])).grid(U, U), -1, 0)
    assert abs(x * x + y * y - 4 - 9 * z * z).max() <= 40 * EPS * 13


@given(curves(max_degree=5, max_spans=3), seeds())
def test_revolution_against_occt(curve, rng):
    """The same generating curve at the same parameter and angle."""
    theirs = Geom_SurfaceOfRevolution(geom_curve(curve), gp_Ax1(gp.Origin_s(), gp_Dir(0, 0, 1)))
    v = rng.uniform(0, 1, 8)
    u = curve.kv.start + (curve.kv.stop - curve.kv.start) * rng.uniform(0, 1, 8)
    angles = np.arctan2(*circular_arc(1.0)(v).T[::-1]) % (2 * np.pi)
    want = [theirs.Value(a, b).Coord() for a, b in zip(angles.tolist(), u.tolist())]
    assert abs(revolved(curve)(u, v) - want).max() <= 200 * EPS


def test_occt_converts_the_revolution_to_as_many_points():
    """GeomConvert turns the half-plane of a degree 2 curve by 2 pi into 3 segments as well."""
    curve = meridian(Conic(9.0, 0.5), 4.0).transform(IN_SPACE)
    theirs = GeomConvert.SurfaceToBSplineSurface_s(
        Geom_SurfaceOfRevolution(geom_curve(curve), gp_Ax1(gp.Origin_s(), gp_Dir(0, 0, 1)))
    )
    ours = revolved(curve)
    assert spline_surface(theirs).coefficients.shape == ours.coefficients.transpose(1, 0, 2).shape


def test_plane_curves_are_meridians():
    """Points (r, z) and (r, 0, z) give the same surface."""
    curve = circular_arc(1.0, 2.0, centre=(3.0, 1.0))
    assert (revolved(curve).coefficients == revolved(curve.transform(IN_SPACE)).coefficients).all()


def test_curves_of_another_dimension_are_refused():
    with pytest.raises(ValueError, match=r"curve must have points \(r, z\) or \(x, y, z\), got 1 components"):
        revolved(NURBSCurve(KnotVector.uniform(1, 1), np.ones((2, 1))))


# ---- ruled surfaces ----


@given(curves(max_degree=4, max_spans=3), curves(max_degree=4, max_spans=3))
def test_ruled_surfaces_hold_both_curves_and_the_lines_between(curve, other):
    onto = KnotVector(
        other.kv.degree,
        np.interp(other.kv.knots, [other.kv.start, other.kv.stop], [curve.kv.start, curve.kv.stop]),
    )
    other = NURBSCurve(onto, other.coefficients, other.weights)
    surface = ruled(curve, other)
    u = np.linspace(curve.kv.start, curve.kv.stop, 23)
    a, b, between = (surface(u, np.full_like(u, v)) for v in (0.0, 1.0, 0.3))
    assert surface.kv_u.degree == max(curve.kv.degree, other.kv.degree)
    # up to three elevations and one insertion, each with some 6 p roundings of the homogeneous coefficients
    assert abs(a - curve(u)).max() <= 4 * 60 * EPS
    assert abs(b - other(u)).max() <= 4 * 60 * EPS
    near, far = ((c.kv.collocation(u) @ c.weights)[:, None] for c in (curve, other))
    share = 0.3 * far / (0.7 * near + 0.3 * far)
    assert abs((1 - share) * a + share * b - between).max() <= 4 * 60 * EPS


def test_knots_of_both_curves_are_kept_once():
    curves_ = [
        NURBSCurve(kv, np.random.default_rng(0).uniform(-1, 1, (kv.dim, 3)))
        for kv in (KnotVector.uniform(3, 2), KnotVector.uniform(2, 4))
    ]
    surface = ruled(*curves_)
    assert surface.kv_u.degree == 3
    assert surface.kv_u.knots.tolist() == [0] * 4 + [0.25] * 2 + [0.5] * 2 + [0.75] * 2 + [1] * 4


def test_cylinders_and_cones():
    base = circular_arc(3.0).transform([[1, 0], [0, 1], [0, 0]])
    cylinder = ruled(base, base.transform(np.eye(3), [0, 0, 5]))
    assert area(cylinder) == pytest.approx(2 * np.pi * 3 * 5, rel=1e-13)
    tip = NURBSCurve(KnotVector.uniform(1, 1), [[0, 0, 4]] * 2)
    assert area(ruled(base, tip)) == pytest.approx(np.pi * 3 * 5, rel=1e-13)


def test_ruled_surfaces_are_refused():
    with pytest.raises(
        ValueError, match=r"the same interval of parameters, got \(0\.0, 1\.0\) and \(0\.0, 2\.0\)"
    ):
        ruled(line([0, 0], [1, 0]), NURBSCurve(KnotVector.uniform(1, 1, 0, 2), np.zeros((2, 2))))
    with pytest.raises(ValueError, match="points of the same dimension, got 2 and 3"):
        ruled(line([0, 0], [1, 0]), line([0, 0, 0], [1, 0, 0]))
