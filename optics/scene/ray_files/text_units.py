"""Units that the head of a text of rays names: of length by its words, of flux by lm or W."""

from __future__ import annotations

import re

from optics.base.runtime import UserError
from optics.scene.ray_files.ray_set import Unit

LENGTHS = {  # mm
    "mm": 1.0,
    "millimeter": 1.0,
    "millimetre": 1.0,
    "cm": 10.0,
    "centimeter": 10.0,
    "centimetre": 10.0,
    "m": 1000.0,
    "meter": 1000.0,
    "metre": 1000.0,
    "in": 25.4,
    "inch": 25.4,
    "inches": 25.4,
    "ft": 304.8,
    "foot": 304.8,
    "feet": 304.8,
}
OF_WAVELENGTHS = {"um", "\u00b5m", "\u03bcm", "micron", "microns", "nm"}
OTHER_LENGTHS = OF_WAVELENGTHS | {"micrometer", "micrometre", "mil", "km", "dm", "yard"}
WORD = "([a-z\u00b5\u03bc]+)"
NAMED = [
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        rf"\b[xyz]\s*[\[(]\s*{WORD}\s*[\])]",  # x[mm], y (mm)
        rf"\b[xyz](?:_|\s*/\s*|\s+in\s+){WORD}\b",  # x_mm, x/mm, z in mm
        r"\b(?:lengths?|positions?|coordinates?|units?)(?>(?:\s+(?:of\s+length|are|is|in|units?)\b)*)\s*+"
        rf"(?:[:=\[(]\s*+)?{WORD}\b",  # unit inch, lengths in cm, units: m
        r"(?<![0-9])(?<![0-9][ -])\b((?:milli|centi)met(?:er|re)s?|inch(?:es)?)\b",  # not: a lens of 1 inch
        r"[\[(]\s*(mm|cm|m|in)\s*[\])]",
    )
]
LUMENS = re.compile(r"\blm\b|\blumens?\b", re.IGNORECASE)
LONGEST = 1000  # letters of a line that are searched
WAVELENGTH = re.compile(r"wavelength|lambda|spectr", re.IGNORECASE)
WATTS = re.compile(r"[\[(]\s*W\s*[\])]|\b(?:in|unit:?)\s+W\b|[:=]\s*W\b|\b[Ww]atts?\b")


def length_units(head: list[str]) -> set[float]:
    """Return mm per unit of every length unit that a head names.

    Raises UserError : a unit of length that is not read.
    """
    words: set[str] = set()
    for line in head:
        named = {word.lower() for pattern in NAMED for word in pattern.findall(line[:LONGEST])}
        words |= named - OF_WAVELENGTHS if WAVELENGTH.search(line) else named
    words |= {word.removesuffix("s") for word in words}
    for word in sorted(words & OTHER_LENGTHS):
        raise UserError(f"its head names the unit {word} of length; write the rays in mm, cm, m, inch or ft")
    return {LENGTHS[word] for word in words if word in LENGTHS}


def flux_unit(head: str) -> Unit:
    """Return the unit of flux that a head names, W where it names none.

    Raises UserError : it names both.
    """
    lumens, watts = LUMENS.search(head), WATTS.search(head)
    if lumens and watts:
        raise UserError(
            f"its head names two units of flux, {watts[0]!r} and {lumens[0]!r}; name the one of its rays"
        )
    return "lm" if lumens else "W"
