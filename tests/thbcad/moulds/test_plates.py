"""Plates, inserts and shrinkage: where lenses lie, volumes in closed form, numbers kept pole by pole."""

import re

import numpy as np
import pytest

from tests.thbcad.cad.shapes.cases import CASES, assert_whole, same_bits
from thbcad.cad.exchange import SolidState, optical_form
from thbcad.cad.shapes import insert_part
from thbcad.lens import (
    MIRROR_SIDES,
    FreeformSurface,
    Lens,
    Product,
    optical_forms,
    optical_places,
    require_sound,
)
from thbcad.moulds import Insert, Plate, enlarged, shrinkage_factors
from thbcad.outlines import Outline, Polygon
from thbcad.sags import Conic, PlacedConic

FLAT = FreeformSurface((5.0, 4.0))
BLOCK = Lens(FLAT, FLAT, 4.0, 1.5)
CUP = FreeformSurface((5.0, 4.0), Conic(5.0, -1.0))  # its rim at z = 1.6 to 4.1 mm


def test_a_plate_of_blocks_has_the_volume_of_blocks_and_of_the_land_between_them():
    plate = Plate.of(BLOCK, (3, 2), (11.0, 10.0))
    land = 33.0 * 20.0 - 6 * 80.0
    assert (plate.low, plate.high) == (1.0, 3.0)  # half of the room between the rims, in its middle
    assert plate.volume() == pytest.approx(6 * 80.0 * 4.0 + 2.0 * land, rel=1e-14)


@pytest.mark.parametrize("turned", [False, True])
def test_slanted_edges_leave_the_land_what_a_frustum_does_not_fill(turned):
    sides = FreeformSurface((4.0, 3.0)), FLAT
    plate = Plate.of(Lens(*sides[:: 1 - 2 * turned], 4.0, 1.5), (2, 1), (11.0, 9.0))
    area = np.polynomial.Polynomial([8.0, 0.5]) * np.polynomial.Polynomial([6.0, 0.5])  # at z
    inside = area.integ()(3.0) - area.integ()(1.0)
    assert plate.volume() == pytest.approx(2 * (area.integ()(4.0) - inside) + 2.0 * 22.0 * 9.0, rel=1e-13)


@pytest.mark.parametrize("counts", [(1, 1), (2, 3), (4, 3)])
def test_the_first_lens_lies_nearest_to_the_middle_and_all_on_the_lattice(counts):
    plate = Plate.of(BLOCK, counts, (11.0, 10.0))
    steps = plate.places / (11.0, 10.0)
    assert (plate.places[0] == 0).all()
    assert len({tuple(step) for step in steps}) == counts[0] * counts[1]
    assert (steps == np.round(steps)).all()
    assert np.abs(np.divide(plate.middle, (11.0, 10.0))).max() <= 0.5
    assert (np.ptp(steps, axis=0) + 1 == counts).all()
    assert plate.outline.half_width == (counts[0] * 5.5, counts[1] * 5.0)


@pytest.mark.parametrize(
    ("lens", "pitch", "words"),
    [
        (BLOCK, (10.0, 9.0), "10 mm wide in x cannot lie 10 mm apart: make the pitch larger"),
        (BLOCK, (11.0, 7.0), "8 mm wide in y cannot lie 7 mm apart"),
        (Lens(CUP, CUP, 2.0, 1.5), (11.0, 9.0), "up to z = 4.1 mm, the rear's down to 3.6 mm; make the lens"),
        (Lens(CUP, FLAT, 1.0, 1.5), (11.0, 9.0), "the surfaces cross"),
    ],
)
def test_lenses_that_touch_or_have_no_room_for_the_land_make_no_plate(lens, pitch, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        Plate.of(lens, (2, 2), pitch)


def test_a_lens_with_another_outline_has_the_same_land():
    lens = CASES["round"][0]
    assert Plate.of(lens, (2, 1), (21.0, 17.0)).volume() > 2 * lens.volume()


PLATE = FreeformSurface((5, 4), corners=(2, 1))


@pytest.mark.parametrize("name", [*CASES, "rounded"])
@pytest.mark.parametrize("number", [0, 1])
def test_an_insert_is_sound_and_has_the_poles_of_the_lens(name, number):
    """Volumes to the 1e-6 that is asked of OCCT's integral; beside the optical face only walls and a back."""
    lens = CASES[name][0] if name in CASES else Lens(PLATE, PLATE, 3, 1.5)
    insert = Insert.of(lens, ("front", "rear")[number])
    part = insert_part(insert)
    state = SolidState(part.solid)
    assert_whole(state, 2 + len(insert.shape.pieces))
    assert state.volume == pytest.approx(insert.volume(), rel=1e-6)
    assert same_bits(optical_form(part.faces[0]), optical_forms(lens)[number])
    assert optical_places(Product(sides=MIRROR_SIDES).named(part.names)) is None  # its back is no mirror's


ROUND = (10.0, 10.0)
BOWL = Lens(
    FreeformSurface(ROUND, Conic(-30.0, -1.0), None, ROUND), FreeformSurface(ROUND, corners=ROUND), 5.0, 1.5
)


@pytest.mark.parametrize(
    ("shape", "reach"),
    [
        (None, 10.0),
        (Outline((3.0, 3.0), (3.0, 3.0)), 3.0),
        (Polygon(((-3.0, -3.0), (3.0, -3.0), (0.0, 3.0))), 10.0),  # a bound, of the whole disk
    ],
    ids=["disk", "aperture", "polygon"],
)
def test_the_back_is_as_far_from_the_rim_as_the_lens_is_thick(shape, reach):
    """The paraboloid reaches -r^2 / 60 on a disk; the corners of its square, no lens, twice as far."""
    rim = -(reach**2) / 60
    assert Insert.of(BOWL, "front", None, shape).back == pytest.approx(rim - 5.0, abs=1e-6)
    assert Insert.of(BOWL, "front", rim - 0.01, shape).back == rim - 0.01
    with pytest.raises(ValueError, match="must lie below z = "):
        Insert.of(BOWL, "front", rim + 0.01, shape)


def test_an_insert_is_that_of_front_or_rear():
    with pytest.raises(ValueError, match="that of front or rear, got 'side'"):
        Insert.of(CASES["flat"][0], "side")


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
