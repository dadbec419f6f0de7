"""Cylinders and spheres as receivers: where rays meet them by a root finder, and charts by closed forms."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from optics.scene.receivers import Cylinder, FarField, Plane, Screen, Sphere
from tests.cases import examples
from thbcad import Pose

RADII = (300.0, -300.0, 45.0, -90.0, 1e7)
TILT = Pose.tilted((3.0, -4.0, 60.0), (20.0, -10.0, 30.0))
EVERY = [kind(TILT, radius=r) for kind in (Cylinder, Sphere) for r in RADII]


def name(receiver):
    return f"{type(receiver).__name__.lower()} {getattr(receiver, 'radius', '')}"


def rays(receiver, count=40, seed=3):
    """Points (3, n) some 60 mm before a receiver, unit directions, and where in its chart they land."""
    rng = np.random.default_rng(seed)
    u, v = 30.0 * rng.uniform(-0.7, 0.7, (2, count))  # a quarter of the smallest of them is 70 mm
    place, normal = (np.stack(np.broadcast_arrays(*f(u, v))) for f in (receiver.points, receiver.normal))
    aslant = normal + rng.uniform(-0.25, 0.25, normal.shape)
    # all come from before the frame too: what runs backward in it never meets a receiver
    return place - 60.0 * aslant, aslant / np.linalg.norm(aslant, axis=0), u, v


@pytest.mark.parametrize("receiver", EVERY, ids=name)
def test_rays_land_where_a_root_finder_meets_the_surface(receiver):
    """The level x^2 (+ y^2) + (z - R)^2 - R^2 over 2 R, which is about z there, changes its sign once between
    the ray's start and the axis, by which a hollow surface is left.  u and v are arcs by their definition."""
    point, direction, _, _ = rays(receiver)
    landed, frame = receiver.land(point, direction), receiver.pose.inverse()
    radius, is_round = receiver.radius, isinstance(receiver, Sphere)

    def own(t, k):
        return (
            Rotation.from_euler("XYZ", (20.0, -10.0, 30.0), degrees=True)
            .inv()
            .apply(point[:, k] + t * direction[:, k] - (3.0, -4.0, 60.0))
        )

    def level(t, k):
        x, y, z = own(t, k)
        return (x * x + is_round * y * y + z * z) / (2 * radius) - z

    assert landed.met.all()
    for k in range(point.shape[1]):
        x, y, z = own(landed.length[k], k)
        # of the two roots it is the nearer, where it bulges to the light, else the farther
        ends = (0.0, landed.length[k] + 2.0) if radius > 0 else (landed.length[k] - 2.0, 1e3)
        assert brentq(level, *ends, args=(k,), xtol=1e-13) == pytest.approx(landed.length[k], abs=2e-9)
        angle = np.arctan2(x / radius, 1 - z / radius)
        assert landed.u[k] == pytest.approx(radius * angle, abs=1e-8)
        assert landed.v[k] == pytest.approx(radius * np.arcsin(y / radius) if is_round else y, abs=1e-8)
    assert np.abs(frame.directions(direction)[0] - landed.p).max() < 1e-14


@pytest.mark.parametrize("receiver", [*EVERY, Plane(TILT), FarField(TILT)], ids=name)
def test_land_and_toward_are_inverse(receiver):
    point, direction, u, v = rays(receiver)
    landed = receiver.land(point, direction)
    again = np.stack(np.broadcast_arrays(*receiver.toward(point, landed.u, landed.v)))
    assert np.abs(again / np.linalg.norm(again, axis=0) - direction).max() < 1e-10
    if not receiver.far_field:
        size = 1e-16 * (abs(getattr(receiver, "radius", 0.0)) + 100.0)
        assert np.abs([landed.u - u, landed.v - v]).max() < 1e4 * size  # rounding, over the cosine
        assert np.abs(point + landed.length * direction - receiver.points(u, v)).max() < 1e4 * size


@pytest.mark.parametrize("receiver", [*EVERY, Plane(TILT), FarField(TILT)], ids=name)
def test_normal_and_area_are_those_of_the_surface_itself(receiver):
    """By differences of its points: X_u x X_v is the area times the normal, which goes with the light."""
    u, v, step = np.array([-12.0, 3.0, 20.0]), np.array([5.0, -17.0, 8.0]), 1e-3
    at = receiver.points if not receiver.far_field else receiver.normal

    def points(a, b):
        return np.stack(np.broadcast_arrays(*at(a, b)))

    along = (points(u + step, v) - points(u - step, v)) / (2 * step)
    up = (points(u, v + step) - points(u, v - step)) / (2 * step)
    both = np.cross(along, up, axis=0) * (np.degrees(1.0) ** 2 if receiver.far_field else 1.0)
    wanted = receiver.area(u, v) * np.stack(np.broadcast_arrays(*receiver.normal(u, v)))
    assert np.abs(both - wanted).max() < 2e-6  # points are exact to 1e-9 mm of a radius of 1e7
    assert ((receiver.pose.rotation[:, 2] @ wanted) > 0).all()  # right-handed, and light goes to +z


@pytest.mark.parametrize("receiver", [Cylinder(radius=50.0), Sphere(radius=50.0)], ids=name)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_light_beside_a_curved_screen_or_from_behind_meets_nothing_and_stays_finite(receiver, sign):
    turned = type(receiver)(radius=sign * receiver.radius)
    x = np.array([0.0, 49.9, 50.1, 80.0, 10.0])
    direction = np.array([[0.0] * 5, [0.0] * 5, [1.0, 1.0, 1.0, 1.0, -1.0]])
    landed = turned.land(np.stack([x, 0 * x, np.full(5, -200.0)]), direction)
    assert landed.met.tolist() == [True, True, False, False, False]
    assert np.isfinite([landed.u, landed.v, landed.length]).all()
    # a hollow one is met inside, at the farther of two places
    assert landed.length[0] == pytest.approx(200.0, abs=1e-12)
    assert landed.length[1] == pytest.approx(200.0 + sign * (50.0 - np.sqrt(50.0**2 - 49.9**2)), abs=1e-11)


@examples(20)
@given(
    radius=st.sampled_from(RADII),
    is_round=st.booleans(),
    x=st.floats(-20, 20),
    y=st.floats(-20, 20),
    slope=st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4)),
)
def test_derivatives_on_the_device_are_those_of_differences(backend, radius, is_round, x, y, slope):
    """Rounding over the step and its third power leave 1e-8, relative to the longest lever, 200 mm."""
    receiver, dr = (
        (Sphere if is_round else Cylinder)(Pose.tilted((0, 0, 60.0), (15, 5, 0)), radius=radius),
        backend.dr,
    )
    start = np.array([x, y, 0.0, *slope])

    def landing(values, library=np, number=float):
        px, py, pz, a, b = values
        length = library.sqrt(1 + a * a + b * b)
        return receiver.land((px, py, pz), (a / length, b / length, 1 / length), library, number)

    values = [backend.Float(float(s)) for s in start]
    dr.enable_grad(values)
    here = landing(values, dr, lambda number: dr.opaque(backend.Float, number))
    if not landing(start).met:
        return
    dr.backward(2 * here.u + 3 * here.v)
    found = np.array([dr.grad(v).numpy()[0] for v in values])
    step = 1e-4

    def value(k, side):
        at = landing(start + side * step * np.eye(5)[k])
        return 2 * at.u + 3 * at.v

    by_differences = [
        (8 * (value(k, 1) - value(k, -1)) - (value(k, 2) - value(k, -2))) / (12 * step) for k in range(5)
    ]
    assert found == pytest.approx(by_differences, rel=1e-8, abs=1e-6)


@pytest.mark.parametrize("receiver", [Cylinder(radius=40.0), Sphere(radius=-40.0)], ids=name)
def test_light_of_the_same_irradiance_everywhere_is_flux_over_the_true_area(receiver):
    """Of the cylinder a rectangle unrolled, of the sphere the zone between two parallels."""
    screen = Screen((30.0, 20.0), (600, 400), receiver=receiver)
    area = screen.projection().sum() * screen.pixel_area
    wanted = 4 * 30 * 20 if type(receiver) is Cylinder else 4 * 30 * 40 * np.sin(20 / 40)
    assert area == pytest.approx(wanted, rel=1.01 * (0.1 / 40) ** 2 / 24)  # the midpoint rule


def test_receivers_are_values_and_tell_what_lies_across_the_axis():
    assert Cylinder(TILT, radius=5.0) == Cylinder(TILT, radius=5.0) != Cylinder(TILT, radius=6.0)
    assert Sphere(TILT, radius=5.0) != Cylinder(TILT, radius=5.0)
    here = Pose.at((0.0, 0.0, 7.0))
    found = [r.across_axis for r in (Plane(here), FarField(), Plane(TILT), Sphere(here, radius=9.0))]
    assert found == [True, True, False, False]
    assert Plane(Pose.at((1.0, 0.0, 7.0))).across_axis is False
