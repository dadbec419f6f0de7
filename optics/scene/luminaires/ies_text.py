"""IES LM-63 files: intensities in cd, from 1986 on, by words and numbers.

The text is read here: photompy 0.3.1 refuses files of 1986 and 1991 and those whose planes run from 90 to 270
degrees, leaves out the ballast factors, and misplaces the mirror images of uneven planes.  It writes.

Source: ANSI/IESNA LM-63-02, Standard file format for the electronic transfer of photometric data, 2002.
"""

from __future__ import annotations

import re
from math import floor, log10
from types import ModuleType

import numpy as np

from optics.base.runtime import UserError
from optics.scene.luminaires.file_numbers import MOST_ANGLES, FileNumbers
from optics.scene.luminaires.intensity_record import Luminaire, Opening
from optics.scene.luminaires.plane_symmetry import full_turn
from thbcad.doors import loaded

TILT = re.compile(r"^[ \t]*TILT[ \t]*=[ \t]*(.*?)[ \t]*$", re.MULTILINE | re.IGNORECASE)
LATER = re.compile(r"LM-63-(2002|2019)")  # they have something else in the place of the ballast-lamp factor
COMMA = re.compile(r"[\d.+-]+,\d+")
FEET, METRES = 304.8, 1000.0  # mm
DECIMALS = 4  # of what photompy writes: it writes smaller numbers with an exponent
# decimal exponent of the greatest number written: rounding changes the flux by at most 2 pi 1e-12 of the
# peak, which is 8e-8 of the flux where one node of half a degree (8e-5 sr) is bright and all others are weak
LEAST_PEAK = 8


def luminaire_of_ies(text: str) -> Luminaire:
    """Return the luminaire of a LM-63 text, of 1986, 1991, 1995, 2002 or 2019.

    Candelas count with the multiplier and the ballast factors, for a luminaire that is not tilted.
    C = 0 lies along the luminaire's length.

    Raises UserError : a text that contradicts itself, decimal commas, photometry of type A or B, factors of
        tilt in another file.
    """
    tilt = TILT.search(text)
    assert tilt is not None
    numbers = text[tilt.end() :]
    later = LATER.search(text[: tilt.start()].split("\n", 1)[0]) is not None
    try:
        return _read(tilt[1], later, numbers.replace(",", " "))
    except UserError:
        comma = COMMA.search(numbers)
        if comma is None or not _is_read(tilt[1], later, numbers.replace(",", ".")):
            raise
    raise UserError(
        f"its numbers have decimal commas or marks of thousands, such as {comma[0]!r}; a comma separates "
        "numbers in LM-63: write decimal points, and thousands without a mark"
    )


def _is_read(tilt: str, later: bool, numbers: str) -> bool:
    try:
        _read(tilt, later, numbers)
    except UserError:
        return False
    return True


def _read(tilt: str, later: bool, text: str) -> Luminaire:
    """Return the luminaire of the numbers behind what TILT= says.  later : than 1995."""
    numbers = FileNumbers(text.split())
    upright = _factor_upright(tilt, numbers)
    lamps = numbers.number("number of lamps")
    each = numbers.number("lumens per lamp")
    factor = upright * _positive(numbers, "candela multiplier")
    verticals = numbers.whole("number of vertical angles", 2, MOST_ANGLES)
    horizontals = numbers.whole("number of horizontal angles", 1, MOST_ANGLES)
    kind = numbers.whole("photometric type", 1, 3)
    if kind != 1:
        raise UserError(
            f"its photometry is of type {'CBA'[kind - 1]}, and only type C is read; convert it to type C"
        )
    unit = (FEET, METRES)[numbers.whole("units type", 1, 2) - 1]
    width, length, _ = (unit * numbers.number(f"luminous {side}") for side in ("width", "length", "height"))
    factor *= _positive(numbers, "ballast factor")
    if later:
        numbers.number("file generation type")
    else:
        factor *= _positive(numbers, "ballast-lamp factor")
    numbers.number("input watts")
    gammas = numbers.row(verticals, "vertical angles")
    planes = numbers.row(horizontals, "horizontal angles")
    candela = numbers.row(verticals * horizontals, "candela values").reshape(horizontals, verticals)
    numbers.require_end()
    planes, candela = full_turn(planes, candela)
    lumens = None if each < 0 else lamps * each
    # negative sizes are round; a width alone is a diameter
    if width < 0 and length == 0:
        length = width
    return Luminaire(
        planes, gammas, factor * candela, Opening((abs(length), abs(width)), width < 0 and length < 0), lumens
    )


def writing_package() -> ModuleType:
    """Return the package that writes.

    Raises MissingPackage : it, or what it needs, is not installed.
    """
    return loaded("photompy")


def ies_bytes(luminaire: Luminaire, title: str) -> bytes:
    """Return the bytes of a LM-63-2019 file: absolute photometry of type C over the grid of the luminaire.

    Numbers are decimals without an exponent, of at least 13 digits at the peak.
    """
    digits = max(0, LEAST_PEAK - floor(log10(luminaire.candela.max())))
    scale = 10.0**-digits
    length, width = (-size if luminaire.opening.round else size for size in luminaire.opening.size)
    file = writing_package().create_ies(
        thetas=luminaire.gammas,
        phis=luminaire.planes,
        values=luminaire.candela / scale,
        manufacturer="not named",
        lumcat=" ".join(title.split()),
        test="traced, not measured",
        testlab="thbcad",
        issuedate="not dated",
        lumens_per_lamp=-1,
        width=width / METRES,
        length=length / METRES,
    )
    file.header = file.header.update(multiplier=f"{scale:.{digits}f}")
    return bytes(file.write(precision=DECIMALS))


def _factor_upright(tilt: str, numbers: FileNumbers) -> float:
    """Return the factor of a lamp's light in a luminaire that is not tilted.  tilt : what TILT= says."""
    if tilt.upper() == "NONE":
        return 1.0
    if tilt.upper() != "INCLUDE":
        raise UserError(f"its factors of tilt are in {tilt[:40]!r}; write TILT=NONE, or put them in the file")
    numbers.number("lamp geometry")
    count = numbers.whole("number of tilt angles", 1, MOST_ANGLES)
    angles, factors = (numbers.row(count, f"tilt {what}") for what in ("angles", "factors"))
    return float(np.interp(0.0, angles, factors))


def _positive(numbers: FileNumbers, what: str) -> float:
    value = numbers.number(what)
    if value <= 0:
        raise UserError(f"its {what} must be greater than 0, got {value:g}")
    return value
