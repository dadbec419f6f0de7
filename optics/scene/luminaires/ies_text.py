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
from optics.scene.luminaires.goniometer_types import TYPE_C, as_type_c
from optics.scene.luminaires.intensity_record import Luminaire, Opening
from optics.scene.luminaires.plane_symmetry import full_turn
from thbcad.doors import loaded

TILT = re.compile(r"^[ \t]*TILT[ \t]*=(.*)$", re.MULTILINE | re.IGNORECASE)
YEAR = re.compile(r"IES(?:NA)?:? *(?:LM-63-?)?(\d{4}|\d\d)\b")
FIRST_YEAR = 1986  # of the standard
LATER = 2002  # from then on something else is in the place of the ballast-lamp factor
COMMA = re.compile(r"(?<![\d.+-])[\d.+-]++,\d+")
DECIMAL_COMMA = re.compile(r"(?<![\d.,])0,\d|\d,(?!\d{3}(?!\d))\d")  # such a comma marks no thousands
LOWEST, HORIZON = (-90.0, 0.0), 90.0  # degrees, where vertical angles begin; HORIZON: all light goes up
SIDES = ("width", "length", "height")
FEET, METRES = 304.8, 1000.0  # mm
DECIMALS = 4  # of what photompy writes: it writes smaller numbers with an exponent
# decimal exponent of the greatest number written: rounding changes the flux by at most 2 pi 1e-12 of the
# peak, which is 8e-8 of the flux where one node of half a degree (8e-5 sr) is bright and all others are weak
LEAST_PEAK = 8


def luminaire_of_ies(text: str) -> Luminaire:
    """Return the luminaire of a LM-63 text, of 1986, 1991, 1995, 2002 or 2019.

    Candelas count with the multiplier and the ballast factors, for a luminaire that is not tilted.
    C = 0 lies along the luminaire's length.  Photometry of types A and B is converted to type C.

    Raises UserError : a text that contradicts itself, commas that may be marks of thousands, factors of tilt
        in another file.
    """
    *_, tilt = TILT.finditer(text)  # numbers alone follow it
    first, _, _ = text.partition("\n")
    year, kind, numbers = _year(first), tilt[1].strip(), text[tilt.end() :]
    try:
        return _read(kind, year, numbers.replace(",", " "))
    except UserError as error:
        if "," not in numbers:
            raise
        try:
            luminaire = _read(kind, year, numbers.replace(",", "."))
        except UserError:
            raise error from None
    if "." in numbers or DECIMAL_COMMA.search(numbers) is None:
        comma = COMMA.search(numbers) or ","
        raise UserError(
            f"its numbers have decimal commas or marks of thousands, such as {comma[0]!r}; a comma separates "
            "numbers in LM-63: write decimal points, and thousands without a mark"
        )
    return luminaire


def _year(first: str) -> int:
    """Return the year of the standard that the first line of a file names; that of 1986 has no such line."""
    found = YEAR.match(first.strip().upper())
    if not found:
        return FIRST_YEAR
    year = int(found[1])
    return year if year >= FIRST_YEAR else year + (1900 if year >= FIRST_YEAR % 100 else 2000)


def _read(tilt: str, year: int, text: str) -> Luminaire:
    """Return the luminaire of the numbers behind what TILT= says.  year : of the standard."""
    numbers = FileNumbers(text.split())
    upright = _factor_upright(tilt, numbers)
    lamps = numbers.number("number of lamps")
    each = numbers.number("lumens per lamp")
    factor = upright * _positive(numbers, "candela multiplier")
    verticals = numbers.whole("number of vertical angles", 2, MOST_ANGLES)
    horizontals = numbers.whole("number of horizontal angles", 1, MOST_ANGLES)
    kind = numbers.whole("photometric type", 1, 3)
    unit = (FEET, METRES)[numbers.whole("units type", 1, 2) - 1]
    width, length, height = (unit * numbers.number(f"luminous {side}") for side in SIDES)
    _require_ballast_record(numbers, verticals, horizontals)
    factor *= _positive(numbers, "ballast factor")
    if year >= LATER:
        numbers.number("file generation type")
    else:
        factor *= _positive(numbers, "ballast-lamp factor")
    numbers.number("input watts")
    vertical = numbers.row(verticals, "vertical angles")
    horizontal = numbers.row(horizontals, "horizontal angles")
    candela = numbers.row(verticals * horizontals, "candela values").reshape(horizontals, verticals)
    numbers.require_end()
    if kind == TYPE_C:
        planes, candela = full_turn(horizontal, candela)
        gammas = vertical
    else:
        planes, gammas, candela = as_type_c(kind, vertical, horizontal, candela)
    lumens = None if each < 0 else lamps * each
    return Luminaire(planes, gammas, factor * candela, _opening(year, width, length, height), lumens)


def _opening(year: int, width: float, length: float, height: float) -> Opening:
    """Return what is seen along gamma = 0 of a luminous opening, whose signs say its shape.

    A negative width or length is that of something round; where the other one is 0 it is a circle.  A
    negative height turns a cylinder over: it lies, and is seen as a rectangle.  Until 1995 the diameter of
    such a cylinder is its height; from 2002 on its length alone is positive.
    """
    size, round_ = (abs(length), abs(width)), width < 0 or length < 0
    if height < 0 and year < LATER and not round_:
        size = (abs(length) or abs(height), abs(width) or abs(height))
    elif height < 0 and year >= LATER and length != 0 and not (width < 0 and length < 0):
        round_ = False
    elif round_ and 0 in size:
        size = (max(size), max(size))
    return Opening(size, round_)


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
    text: bytes = file.write(precision=DECIMALS)
    return b"\r\n".join(text.splitlines()) + b"\r\n"  # LM-63 demands CR LF


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


def _require_ballast_record(numbers: FileNumbers, verticals: int, horizontals: int) -> None:
    """Raise UserError where vertical angles seem to follow next.

    They ascend from 0 or -90, or from 90 where just the horizontal angles and candela values follow.
    """
    angles = numbers.ascending(verticals)
    alone = numbers.left == verticals + horizontals + verticals * horizontals
    if angles.size and (angles[0] in LOWEST or (alone and angles[0] == HORIZON)):
        raise UserError(
            f"{verticals} ascending numbers from {angles[0]:g} to {angles[-1]:g} are where its ballast "
            "factor must be; the line with ballast factor, future use and input watts may be missing: add "
            "it before the vertical angles, such as 1 1 0"
        )


def _positive(numbers: FileNumbers, what: str) -> float:
    value = numbers.number(what)
    if value <= 0:
        raise UserError(f"its {what} must be greater than 0, got {value:g}")
    return value
