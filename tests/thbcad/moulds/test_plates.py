"""Plates: where the lenses lie, the volume in closed form, and what makes no plate."""

import re

import numpy as np
import pytest

from tests.thbcad.cad.shapes.cases import CASES
from thbcad.lens import FreeformSurface, Lens
from thbcad.moulds import Plate
from thbcad.sags import Conic

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
