"""A rear of given shape behind a front that is looked for: where rays land, and where to aim them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import brentq

from optics.light.refraction import FixedRear, ShapedFront
from optics.scene.receivers import receiver_at
from oracles.light_formulas import refracted_vector
from thbcad.sags import Conic

CONICS = {
    "plane": Conic(),
    "sphere": Conic(-30.0),
    "paraboloid": Conic(25.0, -1.0),
    "ellipsoid": Conic(40.0, 0.5),
}
FAR = float("inf")


def landing_by_hand(rear, point, slopes):
    """Return where one ray lands: the meeting by bisection, refraction by vectors."""
    (x, y, z), (p, q) = point, slopes
    t = brentq(lambda t: z + t - rear.thickness - rear.conic(x + p * t, y + q * t), -20.0, 20.0, xtol=1e-14)
    at = np.array([x + p * t, y + q * t, z + t])
    zx, zy = (float(rear.conic(at[0], at[1], d)) for d in ((1, 0), (0, 1)))
    along, normal = np.array([p, q, 1.0]), np.array([-zx, -zy, 1.0])
    units = (v[None, :] / np.linalg.norm(v) for v in (along, normal))
    (out,) = refracted_vector(*units, rear.index)
    if rear.receiver.far_field:
        return np.degrees(np.arctan2(out[:2], out[2]))
    return at[:2] + out[:2] / out[2] * (rear.receiver.pose.shift[2] - at[2])


@pytest.mark.parametrize("target_z", [20.0, FAR])
@pytest.mark.parametrize("conic", CONICS.values(), ids=CONICS)
@given(st.tuples(*[st.floats(-4.0, 4.0)] * 2), st.tuples(*[st.floats(-0.25, 0.25)] * 2), st.floats(-1.0, 1.0))
def test_rays_land_where_the_vector_law_says(conic, target_z, place, slopes, height):
    rear = FixedRear(1.57, conic, 2.0, receiver_at(target_z))
    point = (*place, height)
    found = rear.landing([np.array([[a]]) for a in point], [np.array([[a]]) for a in slopes])
    np.testing.assert_allclose(np.ravel(found), landing_by_hand(rear, point, slopes), rtol=0, atol=1e-10)


@pytest.mark.parametrize(("place", "slopes"), [((5.0, 4.0), (0.8, 0.5)), ((6.0, -1.0), (1.1, 0.0))])
def test_rays_as_flat_as_the_rear_meet_it_too(place, slopes):
    rear = FixedRear(1.5, Conic(-10.0, -1.0), 5.0, receiver_at(1000.0))
    point = (*place, 0.5)
    found = rear.landing([np.array([[a]]) for a in point], [np.array([[a]]) for a in slopes])
    np.testing.assert_allclose(np.ravel(found), landing_by_hand(rear, point, slopes), rtol=1e-9)


def test_rays_that_miss_the_rear_land_nowhere():
    rear = FixedRear(1.5, Conic(-10.0), 5.0, receiver_at(1000.0))
    found = rear.landing([np.array([[a]]) for a in (15.0, 0.0, 0.0)], [np.zeros((1, 1))] * 2)
    assert np.isnan(found).all()


@pytest.mark.parametrize("target_z", [20.0, FAR])
@pytest.mark.parametrize("conic", CONICS.values(), ids=CONICS)
def test_aimed_light_lands_where_it_is_wanted(conic, target_z):
    rng = np.random.default_rng(5)
    rear = FixedRear(1.57, conic, 2.0, receiver_at(target_z))
    points = rng.uniform([[-4], [-4], [-0.5]], [[4], [4], [0.5]], (3, 400))
    wanted = rng.uniform(-8, 8, (2, 400))
    inside, reached = rear.aimed(points, wanted)
    assert reached.all()
    np.testing.assert_allclose(np.linalg.norm(inside, axis=0), 1.0, rtol=0, atol=1e-14)
    found = rear.landing(points, [inside[0] / inside[2], inside[1] / inside[2]])
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)


def test_what_a_plane_cannot_reach_is_told():
    """Behind a plane light leaves by less than 90 degrees, and the aim stops shortly before."""
    rear = FixedRear(1.5, Conic(), 2.0, receiver_at(3.0))
    point = [np.zeros(2), np.zeros(2), np.zeros(2)]
    inside, reached = rear.aimed(point, [np.array([1.0, 50.0]), np.zeros(2)])
    assert reached.tolist() == [True, False]
    assert np.isfinite(inside).all()


@pytest.mark.parametrize("conic", CONICS.values(), ids=CONICS)
def test_slopes_of_a_front_send_light_to_where_it_is_wanted(conic):
    front = ShapedFront(FixedRear(1.57, conic, 2.0, receiver_at(20.0)))
    rng = np.random.default_rng(6)
    points = rng.uniform([[-4], [-4], [-0.5]], [[4], [4], [0.5]], (3, 400))
    along, wanted = rng.uniform(-0.05, 0.05, (3, 400)), rng.uniform(-6, 6, (2, 400))
    along[2] = np.sqrt(1 - along[0] ** 2 - along[1] ** 2)
    slopes, gentle, refracts = front.slopes(points, along, wanted)
    assert gentle.all()
    assert refracts.all()
    np.testing.assert_allclose(front.landing(points, along, slopes), wanted, rtol=0, atol=1e-9)
