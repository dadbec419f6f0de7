"""How the numbers of a picture become linear light: by the curve that its file states, else by that of sRGB.

A PNG file may state the exponent g of its numbers, v = light^g, in a chunk gAMA.  A picture of any format may
hold an ICC profile, whose curve maps v to light: an exponent, a table, or one of five formulas.  A profile
goes before gAMA, and the chunk sRGB of a PNG file before both.

Sources: PNG specification (W3C, third edition), 4.3 and 12.1; ICC.1:2022, 10.6 and 10.18; IEC 61966-2-1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from struct import error as StructError, unpack_from
from typing import Any, NamedTuple

import numpy as np

from thbcad.checks import Floats

LIKE_SRGB = 0.01  # greatest difference of a curve from that of sRGB that counts as none
USUAL = 1 / 2.2  # the exponent by which PNG files mean sRGB
SAME_EXPONENT = 0.005
TAGS = (b"kTRC", b"gTRC")  # of grey pictures, and of green, which has most of the luminance
PARAMETERS = (1, 3, 4, 5, 7)  # of the five formulas


class Curve(NamedTuple):
    """A curve from numbers 0 to 1 to light.  stated : where a file states one that is not sRGB's, else ""."""

    decoded: Callable[[Floats], Floats]
    stated: str = ""


def curve_of(info: Mapping[Any, Any], encoding: str) -> Curve:
    """Return the curve of a picture.

    info : of Pillow.  encoding : "linear", or "srgb" for what the file states.

    Raises ValueError : an ICC profile whose curve is constant, negative or infinite.
    """
    if encoding == "linear":
        return LINEAR
    if "srgb" in info:
        return SRGB
    if profile := info.get("icc_profile"):
        return _unless_srgb(_of_profile(profile), "the ICC profile of the file")
    gamma = info.get("gamma", USUAL)
    if not 0 < gamma < np.inf or abs(gamma - USUAL) < SAME_EXPONENT:
        return SRGB
    return Curve(_power(1 / gamma), f"the chunk gAMA of the file, {gamma:g}")


def srgb_decoded(values: Floats) -> Floats:
    """Undo the curve of sRGB."""
    low = values <= 0.04045
    return np.where(low, values / 12.92, ((np.maximum(values, 0.04045) + 0.055) / 1.055) ** 2.4)


def _linear(values: Floats) -> Floats:
    return values


def _power(exponent: float) -> Callable[[Floats], Floats]:
    return lambda values: np.where(values < 0, values, np.maximum(values, 0.0) ** exponent)


def _unless_srgb(decoded: Callable[[Floats], Floats] | None, stated: str) -> Curve:
    values = np.linspace(0, 1, 256)
    if decoded is None:
        return SRGB
    with np.errstate(all="ignore"):  # of damaged profiles
        light = decoded(values)
    if not (np.isfinite(light).all() and light.min() >= 0 and light.max() > light.min()):
        raise ValueError(f"{stated} is damaged, because its curve leads from {light[0]:g} to {light[-1]:g}")
    return SRGB if np.abs(light - srgb_decoded(values)).max() < LIKE_SRGB else Curve(decoded, stated)


def _of_profile(profile: bytes) -> Callable[[Floats], Floats] | None:
    """Return the curve of an ICC profile; None where it has none, or is damaged."""
    try:
        (count,) = unpack_from(">I", profile, 128)
        entries = [unpack_from(">4sII", profile, 132 + 12 * k) for k in range(min(count, 100))]
        places = {tag: (start, size) for tag, start, size in entries}
        start, size = next(places[tag] for tag in TAGS if tag in places)
        return _of_tag(profile[start : start + size])
    except (StructError, StopIteration, ValueError):
        return None


def _of_tag(tag: bytes) -> Callable[[Floats], Floats] | None:
    """Return the curve of a tag of the type curv or para."""
    if tag[:4] == b"curv":
        (count,) = unpack_from(">I", tag, 8)
        if count == 0:
            return _linear
        if count == 1:
            return _power(unpack_from(">H", tag, 12)[0] / 256)
        table = np.frombuffer(tag, ">u2", count, 12) / 65535
        return lambda values: np.interp(values, np.linspace(0, 1, count), table)
    if tag[:4] != b"para":
        return None
    (kind,) = unpack_from(">H", tag, 8)
    if kind >= len(PARAMETERS):
        return None
    given = [n / 65536 for n in unpack_from(f">{PARAMETERS[kind]}i", tag, 12)]
    g, a, b, c, d, e, f = [*given, *[0.0] * 6][: PARAMETERS[-1]]
    if kind == 0:
        return _power(g)
    if kind < 3:
        return lambda v: np.maximum(a * v + b, 0.0) ** g + c  # c is 0 in the formula without it
    return lambda v: np.where(v >= d, np.maximum(a * v + b, 0.0) ** g + e, c * v + f)


LINEAR, SRGB = Curve(_linear), Curve(srgb_decoded)
