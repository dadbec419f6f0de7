"""Proven bounds beside dense samples, on a paraboloid whose extremes are known."""

from math import atan, degrees, hypot, inf

import pytest

from optics.interface.audit.dense_samples import BoundGap, bound_gaps
from thbcad import Conic, FreeformSurface, Lens

R, H = 150.0, 50.0


@pytest.fixture(scope="module")
def gaps():
    flat = FreeformSurface((H, H))
    rear = FreeformSurface((H, H), Conic(R, -1.0))
    return {gap.name: gap for gap in bound_gaps(Lens(flat, rear, thickness=20.0, index=1.5), samples=101)}


@pytest.mark.parametrize(
    ("name", "exact"),
    [
        ("least thickness", 20.0),
        ("greatest thickness", 20.0 + H**2 / R),
        ("slope of the rear", degrees(atan(hypot(H, H) / R))),
        ("concave radius of the rear", R),
        ("convex radius of the rear", inf),
    ],
)
def test_samples_of_a_paraboloid_have_its_extremes(gaps, name, exact):
    assert gaps[name].sampled == pytest.approx(exact, rel=1e-12)
    assert gaps[name].unit == ("°" if "slope" in name else " mm")
    assert gaps[name].holds
    assert gaps[name].gap < 2e-5  # bounds of radii and slopes are 1e-5 wide


@pytest.mark.parametrize(("bound", "sign"), [(0.9, 1), (1.1, -1)])
def test_a_bound_that_a_sample_contradicts_does_not_hold(bound, sign):
    gap = BoundGap("slope", bound, 1.0, sign)
    assert gap.gap == pytest.approx(-0.1)
    assert not gap.holds


def test_a_bound_may_be_beside_its_sample_by_rounding():
    assert BoundGap("slope", 1.0 - 1e-13, 1.0, 1).holds
    assert BoundGap("radius", inf, inf, -1).gap == 0.0
