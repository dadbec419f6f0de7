"""EULUMDAT files (.ldt): intensities in cd per 1000 lm of the lamps, one number a line.

The text is read and written here: photompy 0.3.1 takes the count of all planes for that of the planes that a
symmetric file holds, and writes lamps without colour, wattage and direct ratios, which other readers need.

Source: A. W. Stockmar, EULUMDAT/2, Extended version of a well established luminaire data format, CIBSE
National Lighting Conference 1998.
"""

from __future__ import annotations

import numpy as np

from optics.base.runtime import UserError
from optics.scene.luminaires.file_numbers import MOST_ANGLES, FileNumbers
from optics.scene.luminaires.intensity_record import FULL_TURN, Luminaire, Opening
from optics.scene.luminaires.plane_symmetry import closed, full_turn
from thbcad.checks import Floats

# lines of the header, from 0
SYMMETRY, PLANES, GAMMAS, OPENING, CONVERSION, LAMP_SETS, LAMPS = 2, 3, 5, 15, 23, 25, 26
LINES_OF_LAMPS = 6  # number, name, lumens, colour, colour rendering, watts
RATIOS = 10  # direct ratios for indoor rooms, behind the lamps
FIRST_LINES = 10_000  # letters that surely hold the lines up to the number of angles gamma
DECIMALS = 5  # of cd/klm: a lamp of 1 cd/klm everywhere has 12.6 lm per klm
COUNTS = {
    SYMMETRY: ("symmetry", 0, 4),
    PLANES: ("number of planes C", 1, MOST_ANGLES),
    GAMMAS: ("number of angles gamma", 2, MOST_ANGLES),
    LAMP_SETS: ("number of lamp sets", 1, 20),  # the specification's most
}


def luminaire_of_ldt(text: str) -> Luminaire:
    """Return the luminaire of an EULUMDAT text.

    Its cd/klm are scaled by the lumens of the lamps; of several sets of lamps, which are alternatives, the
    first counts.  C = 0 lies across the luminaire's length, as is usual: its luminous length is along y.

    Raises UserError : a text that contradicts itself.
    """
    lines = _lines(text)
    whole = {
        at: FileNumbers(lines[at : at + 1]).whole(f"{what} (line {at + 1})", low, high)
        for at, (what, low, high) in COUNTS.items()
    }
    symmetry, planes, gammas = whole[SYMMETRY], whole[PLANES], whole[GAMMAS]
    numbers = FileNumbers(lines[OPENING : OPENING + 2])
    length, width = numbers.number("luminous length"), numbers.number("luminous width")
    lumens = FileNumbers(lines[LAMPS + 2 : LAMPS + 3]).number("lumens of the lamps")
    factor = FileNumbers(lines[CONVERSION : CONVERSION + 1]).number("conversion factor")
    if lumens <= 0 or factor <= 0:
        raise UserError(
            f"its lumens and its conversion factor must be greater than 0, got {lumens:g} and {factor:g}"
        )
    ratios = LAMPS + LINES_OF_LAMPS * whole[LAMP_SETS]  # not used, and empty in some files
    data = FileNumbers([word for line in lines[ratios + RATIOS :] for word in line.split()])
    c, gamma = data.row(planes, "planes C"), data.row(gammas, "angles gamma")
    held = _held_planes(symmetry, c)
    candela = data.row(len(held) * gammas, "intensities").reshape(len(held), gammas)
    data.require_end()
    if symmetry == 3:  # from 270 through 0 to 90; as a mirror image from 90 through 180 to 270
        held, candela = (540 - np.where(held < 270, held + FULL_TURN, held))[::-1], candela[::-1]
    if symmetry == 0:
        held, candela = closed(held, candela)
    turn, candela = full_turn(held, candela)
    round_ = width == 0 and length > 0
    opening = Opening((length if round_ else abs(width), abs(length)), round_)
    return Luminaire(turn, gamma, candela * factor * lumens / 1000, opening, lumens)


def begins_as_ldt(text: str) -> bool:
    """Return whether a text has the counts of an EULUMDAT file in their lines; names may be any.

    No line of an IES file before its line TILT= is a whole number alone.
    """
    lines = _lines(text[:FIRST_LINES])
    return all(lines[at].isdecimal() if at < len(lines) else False for at in (SYMMETRY, PLANES, GAMMAS))


def _lines(text: str) -> list[str]:
    """Return the lines of a text, each with one number at most, with decimal points."""
    return [line.strip().replace(",", ".") for line in text.split("\n")]


def _held_planes(symmetry: int, c: Floats) -> Floats:
    """Return the planes whose intensities a file holds, in its order.

    Raises UserError : planes that its symmetry does not allow.
    """
    if symmetry == 0:
        return c
    if symmetry == 1:
        return np.zeros(1)
    n = len(c)
    parts = 4 if symmetry == 4 else 2
    even = 2 if symmetry == 2 else 4
    if n % even:
        raise UserError(f"its symmetry {symmetry} needs planes C in multiples of {even}, got {n}")
    first = 3 * n // 4 if symmetry == 3 else 0
    return np.take(c, np.arange(first, first + n // parts + 1), mode="wrap")


def ldt_bytes(luminaire: Luminaire, title: str) -> bytes:
    """Return the bytes of an EULUMDAT file without symmetry over the grid of the luminaire.

    The lamps have its flux, so that 1000 lm of theirs are 1000 lm of its light.
    """
    flux, c, gamma = luminaire.flux, luminaire.planes[:-1], luminaire.gammas
    below = luminaire.flux_within(90.0) / flux
    x, y = luminaire.opening.size
    sizes = [_text(y), _text(0.0 if luminaire.opening.round and x == y else x)]
    header = [
        *("thbcad", "3", "0", str(len(c)), _step(luminaire.planes), str(len(gamma)), _step(gamma)),
        *("traced, not measured", " ".join(title.split()), "", "", ""),
        *(_text(y), _text(x), "0", *sizes, "0", "0", "0", "0"),
        *(_text(100 * below), "100", "1", "0", "1"),
        *("-1", "light of the luminaire", repr(flux), "", "", "0"),
        *["0"] * RATIOS,
    ]
    numbers = [*map(_text, c), *map(_text, gamma)]
    numbers += [f"{value:.{DECIMALS}f}" for value in (luminaire.candela[:-1] * (1000 / flux)).ravel()]
    return ("\r\n".join([*header, *numbers]) + "\r\n").encode("latin-1", "replace")


def _text(value: float) -> str:
    return f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")


def _step(angles: Floats) -> str:
    """Return the step of angles; 0 stands for uneven ones."""
    steps = np.diff(angles)
    return _text(float(steps[0])) if np.allclose(steps, steps[0], rtol=0, atol=10.0**-DECIMALS) else "0"
