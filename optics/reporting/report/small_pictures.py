"""Light as small pictures for pages that come often: grey values and differences, without axes (PIL)."""

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from thbcad.checks import Floats

LONGEST, ENLARGED = 512, 256  # pixels: larger pictures are reduced, smaller ones enlarged
ALMOST = 0.999  # of the pixels
MOST, LEAST = (178, 24, 43), (33, 102, 172)  # colours of too much light and of too little


def light_pictures(target: Floats, irradiance: Floats) -> list[tuple[str, bytes]]:
    """Return (caption, PNG) of target T, light E and their difference.

    T and E are shown by square roots, as a screen shows grey, on one scale whose top is max T, or almost all
    of E.  E - T is red where light is too much and blue where it lacks; full colours are at max |E - T|.

    target, irradiance : (rows, columns) in one unit, row 0 at +y.
    """
    top = max(float(target.max()), float(np.quantile(irradiance, ALMOST))) or 1.0
    apart = irradiance - target
    span = float(np.abs(apart).max()) or 1.0
    greatest = f"; the greatest is {span / (float(target.mean()) or 1.0):.0%} of the target's mean"
    return [
        ("Target", _png(_grey(target / top))),
        ("Light", _png(_grey(irradiance / top))),
        (f"Light less target{greatest}", _png(_red_and_blue(apart / span))),
    ]


def _grey(light: Floats) -> NDArray[np.uint8]:
    return np.round(255 * np.sqrt(np.clip(light, 0.0, 1.0))).astype(np.uint8)


def _red_and_blue(part: Floats) -> NDArray[np.uint8]:
    """Return colours (rows, columns, 3) of numbers from -1, blue, by 0, white, to 1, red."""
    ends = np.where(part[..., None] > 0, MOST, LEAST)
    return np.round(255 + np.abs(part)[..., None] * (ends - 255.0)).astype(np.uint8)


def _png(pixels: NDArray[np.uint8]) -> bytes:
    picture = Image.fromarray(pixels)
    longest = max(picture.size)
    if longest > LONGEST:
        picture = picture.reduce(-(-longest // LONGEST))
    elif longest <= ENLARGED:
        times = LONGEST // longest
        picture = picture.resize((times * picture.width, times * picture.height), Image.Resampling.NEAREST)
    buffer = io.BytesIO()
    picture.save(buffer, "png", compress_level=3)
    return buffer.getvalue()
