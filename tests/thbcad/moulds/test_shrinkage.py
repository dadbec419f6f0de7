"""Lenses enlarged for the shrinkage of a mould: pole by pole, whatever their surfaces are."""

import numpy as np
import pytest

from tests.thbcad.cad.shapes.cases import CASES
from thbcad.lens import FreeformSurface, Lens, optical_forms, require_sound
from thbcad.moulds import enlarged, shrinkage_factors
from thbcad.sags import Conic, PlacedConic

LIKE, UNLIKE = (1.005,) * 3, (1.004, 0.99, 1.012)
LENSES = {name: lens for name, (lens, _) in CASES.items()} | {
    "sag over a sphere": Lens(
        FreeformSurface((5, 4)), FreeformSurface((5, 4), Conic(-60.0), CASES["round"][0].rear.sag), 4, 1.5
    ),
}


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("factors", [LIKE, UNLIKE])
def test_poles_are_multiplied_within_a_rounding_or_two(name, factors):
    """To 1e-15 of the greatest coordinate: a product, and roundings of knots that were rounded before."""
    lens = LENSES[name]
    big = require_sound(enlarged(lens, factors))
    assert big.volume() == pytest.approx(np.prod(factors) * lens.volume(), rel=1e-12)
    for own, form in zip(optical_forms(lens), optical_forms(big)):
        if isinstance(form, PlacedConic):
            assert form.kind == own.kind
            assert (form.conic.radius, form.conic.constant) == (
                factors[2] * own.conic.radius,
                own.conic.constant,
            )
        elif not isinstance(own, PlacedConic):
            wanted = own.coefficients * factors
            assert (abs(form.coefficients - wanted) <= 1e-15 * abs(wanted).max(axis=(0, 1))).all()


def test_unlike_factors_make_a_spline_of_a_sphere():
    """Its heights are those of the sphere, multiplied, within the 1e-11 mm to which it is a spline."""
    lens = LENSES["sphere"]
    big = enlarged(lens, UNLIKE)
    x, y = np.meshgrid(np.linspace(-5, 5, 9), np.linspace(-4, 4, 9))
    a, b, c = UNLIKE
    assert np.allclose(big.front(a * x, b * y), c * lens.front(x, y), rtol=0, atol=2e-11)


def test_outlines_are_enlarged_with_the_lens():
    """A rounded outline, whose corners are ellipses under unlike factors."""
    surface = FreeformSurface((6, 5), corners=(2, 2))
    big = enlarged(Lens(surface, surface, 3, 1.5), UNLIKE)
    assert big.rear.outline.corners == pytest.approx((2 * 1.004, 2 * 0.99), rel=1e-15)


@pytest.mark.parametrize(
    ("percent", "what"),
    [([1, 2], "one number, or three"), ([np.nan], "finite"), ([60], "at most 50 per cent"), ([], "got 0")],
)
def test_what_is_no_shrinkage_is_refused(percent, what):
    with pytest.raises(ValueError, match=what):
        shrinkage_factors(percent)
