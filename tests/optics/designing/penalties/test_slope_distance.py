"""The distance of slopes has the right gradient and weights, and conics within a range of curvatures are
spheres or paraboloids that are known by their equations."""

from math import inf

import numpy as np
import pytest

from optics.designing.penalties import SlopeDistance, curvature_range
from optics.scene.problem import Limits
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

HALF = 10.0
SPACE = THBSpace(*[KnotVector.uniform(3, 8, -HALF, HALF)] * 2).refine({0: [(1, 2), (2, 2)]})
BASE = Conic(30.0, -1.0)


def paraboloid(curvatures, slopes=(0.0, 0.0)):
    """Return coefficients of a x^2 / 2 + b y^2 / 2 and two slopes, whose products of knots are exact."""
    kv = KnotVector.uniform(3, 8, -HALF, HALF)
    inner = np.stack([kv.knots[i : kv.dim + i] for i in (1, 2, 3)])
    squares = (inner[0] * inner[1] + inner[0] * inner[2] + inner[1] * inner[2]) / 3
    x = inner.mean(axis=0)
    net = (
        curvatures[0] * squares[:, None] / 2
        + curvatures[1] * squares / 2
        + slopes[0] * x[:, None]
        + slopes[1] * x
    )
    return THBSpace(kv, kv).prolongation(SPACE) @ net.ravel()


def surface(coefficients):
    return FreeformSurface((HALF, HALF), BASE, THBSurface(SPACE, coefficients))


def heights(sag, x, y):
    return sag(x, y) + BASE(x, y)


def test_the_distance_of_paraboloids_is_that_of_their_curvatures():
    """Slopes c x of all curvature c: the mean square of a difference d x, relative to that of c x."""
    total = 1 / 30 + 0.002
    distance = SlopeDistance([surface(paraboloid((0.002, 0.002)))], [None])
    value, _ = distance([paraboloid((0.005, 0.002))])
    assert value == pytest.approx(0.003**2 / (2 * total**2), rel=1e-12)


def test_only_slopes_where_light_goes_count():
    """Dark points have a thousandth of the weight, twice for half of the area.  The slopes x over the half
    have a quarter of the variance along it, so that the divisor is 5 / 8 of that of the whole."""
    x = np.linspace(-HALF, HALF, 41)
    right = np.where(x[:, None] > 0, 1.0, 0.0) + np.zeros((41, 41))
    start, other = paraboloid((0.0, 0.0)), paraboloid((0.0, 0.0)).copy()
    left = SPACE.greville()[:, 0] < -5
    other[left] += 0.1
    seen, _ = SlopeDistance([surface(start)], [None])([other])
    unseen, _ = SlopeDistance([surface(start)], [(x, x, right)])([other])
    assert unseen == pytest.approx(1e-3 * 2 / (5 / 8) * seen, rel=0.1)


def test_the_gradient_is_that_of_the_distance():
    rng = np.random.default_rng(3)
    distance = SlopeDistance([surface(0.1 * rng.standard_normal(SPACE.dim))], [None])
    at, direction = 0.1 * rng.standard_normal((2, SPACE.dim))
    h = 1e-3  # of a quadratic function differences are exact
    ahead, behind = (distance([at + s * direction])[0] for s in (h, -h))
    assert distance([at])[1][0] @ direction == pytest.approx((ahead - behind) / (2 * h), rel=1e-9)


def test_a_paraboloid_that_bends_too_much_becomes_the_sphere_of_the_limit():
    distance = SlopeDistance([surface(paraboloid((0.0, 0.0)))], [None])
    (sag,) = distance.conics([(-inf, 1 / 60)])
    x, y = np.array([0.0, 3.0, 9.0, -8.0]), np.array([0.0, 4.0, -9.0, 1.0])
    np.testing.assert_allclose(heights(sag, x, y), 60 - np.sqrt(60**2 - x**2 - y**2), atol=2e-6)


def test_a_range_cuts_each_curvature_alone_and_keeps_the_tilt():
    """Near the axis the surface is x^2 / 120 - y^2 / 80 + 0.02 x: only the first curvature is cut."""
    wanted = paraboloid((0.0, -1 / 30 - 1 / 40), (0.02, 0.0))
    (sag,) = SlopeDistance([surface(wanted)], [None]).conics([(-inf, 1 / 60)])
    at = np.zeros(1)
    assert sag(at, at, (2, 0))[0] + 1 / 30 == pytest.approx(1 / 60, rel=1e-3)
    assert sag(at, at, (0, 2))[0] + 1 / 30 == pytest.approx(-1 / 40, rel=1e-3)
    assert sag(at, at, (1, 0))[0] == pytest.approx(0.02, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "limits", "ends"),
    [
        ("rear", {"concave_radius": 50.0}, (-inf, 0.02)),
        ("front", {"concave_radius": 50.0}, (-0.02, inf)),
        ("rear", {"radius": 20.0, "concave_radius": 50.0}, (-0.05, 0.02)),
        ("rear", {}, (-inf, inf)),
    ],
)
def test_a_hollow_rear_bends_towards_the_target_and_a_hollow_front_away(name, limits, ends):
    assert curvature_range(Limits(**limits), name) == ends
