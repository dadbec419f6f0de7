"""Inserts of a mould: sound solids whose optical face is that of the lens, bit for bit."""

import pytest

from tests.thbcad.cad.shapes.cases import CASES, same_bits
from thbcad.cad.exchange import SolidState, optical_form
from thbcad.cad.shapes import insert_part
from thbcad.lens import FreeformSurface, Lens, optical_forms
from thbcad.moulds import Insert

PLATE = FreeformSurface((5, 4), corners=(2, 1))


@pytest.mark.parametrize("name", [*CASES, "rounded"])
@pytest.mark.parametrize("number", [0, 1])
def test_an_insert_is_sound_and_has_the_poles_of_the_lens(name, number):
    """Volumes to the 1e-6 that is asked of OCCT's integral; beside the optical face only walls and a back."""
    lens = CASES[name][0] if name in CASES else Lens(PLATE, PLATE, 3, 1.5)
    insert = Insert.of(lens, ("front", "rear")[number])
    part = insert_part(insert)
    state = SolidState(part.solid)
    assert (state.valid, state.closed, state.free_edges) == (True, True, 0)
    assert state.tolerance <= 1e-7
    assert state.volume == pytest.approx(insert.volume(), rel=1e-6)
    assert same_bits(optical_form(part.faces[0]), optical_forms(lens)[number])
    assert len(part.faces) == 2 + len(insert.shape.pieces)


def test_an_insert_is_that_of_front_or_rear():
    with pytest.raises(ValueError, match="that of front or rear, got 'side'"):
        Insert.of(CASES["flat"][0], "side")
