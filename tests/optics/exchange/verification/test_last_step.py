"""Where the independent tracers end, on any receiver: against its chart and against optiland's surfaces."""

import numpy as np
import pytest

from optics.exchange.verification import last_step
from optics.scene.receivers import Cylinder, FarField, Plane, Sphere
from thbcad import Pose

WALL = Pose.tilted((4.0, -3.0, 60.0), (25.0, -15.0, 40.0))
RECEIVERS = [
    Plane(WALL),
    FarField(WALL),
    *(kind(WALL, radius=r) for kind in (Cylinder, Sphere) for r in (80.0, -45.0, 1e6)),
]


def rays(count=400):
    """Points (n, 3) and directions: some that miss a screen or come from behind it."""
    rng = np.random.default_rng(8)
    directions = np.column_stack([rng.uniform(-1, 1, (count, 2)), rng.uniform(-0.2, 1, count)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return rng.uniform(-8, 8, (count, 3)), directions


@pytest.mark.parametrize(
    "receiver", RECEIVERS, ids=lambda r: f"{type(r).__name__} {getattr(r, 'radius', '')}"
)
def test_rays_end_where_the_chart_says_and_nowhere_else(receiver):
    """Of those that go less than 10 m: rounding, of a radius squared over the radius in one of them."""
    points, directions = rays()
    found, meets, length = last_step(points, directions, receiver)
    landed = receiver.land(points.T, directions.T)
    assert meets.tolist() == landed.met.tolist()
    assert 0.1 < meets.mean() < 1.0
    steep = meets & (landed.length < 1e4) if not receiver.far_field else meets
    size = 1e-13 * (1e3 + getattr(receiver, "radius", 0.0))
    assert np.abs(found - np.column_stack([landed.u, landed.v]))[steep].max() < 100 * size
    if receiver.far_field:
        assert np.isinf(length).all()
    else:
        assert np.abs(length - landed.length)[steep].max() < 100 * size
        assert np.isinf(length[~meets]).all()


@pytest.mark.parametrize("radius", [np.inf, 90.0, -150.0])
def test_rays_end_where_optiland_meets_a_tilted_plane_or_sphere(radius):
    optiland = pytest.importorskip("optiland.geometries")
    from optiland.coordinate_system import CoordinateSystem
    from optiland.rays import RealRays

    tilt = 25.0
    frame = CoordinateSystem(x=2.0, y=-6.0, z=70.0, rx=np.radians(tilt))
    pose = Pose.tilted((2.0, -6.0, 70.0), (tilt, 0.0, 0.0))
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(-9, 9, (50, 2)), np.zeros(50)])
    directions = np.column_stack([rng.uniform(-0.2, 0.2, (50, 2)), np.ones(50)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    light = RealRays(*points.T, *directions.T, np.ones(50), np.full(50, 0.55))
    shape = optiland.Plane(frame) if np.isinf(radius) else optiland.StandardGeometry(frame, radius, 0.0)
    shape.localize(light)
    wanted = np.asarray(shape.distance(light))
    receiver = Plane(pose) if np.isinf(radius) else Sphere(pose, radius=radius)
    _, meets, length = last_step(points, directions, receiver)
    assert meets.all()
    np.testing.assert_allclose(length, wanted, rtol=0, atol=1e-11)
