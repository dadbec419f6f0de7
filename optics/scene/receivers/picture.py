"""Pictures as targets: files into linear light."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from optics.base.runtime import UserError, note, require_regular_file
from optics.scene.receivers.picture_curves import curve_of
from thbcad.checks import Floats

LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear sRGB (IEC 61966-2-1)
MAX_SOURCE_PIXELS = 100_000_000  # 0.8 GB as linear light; Pillow itself refuses 179 million
BAND_PIXELS = 1 << 20  # decoded together
DEEPEST = 65535  # of whole numbers
PHOTOMETRIC = 262  # the tag of a TIFF that says what 0 stands for
DEEP_MODES = ("I;16", "I;16B", "I;16L", "I")
# Pillow's name and ours; none of them starts another program, as EPS does
FORMATS = {
    "PNG": "PNG",
    "JPEG": "JPEG",
    "TIFF": "TIFF",
    "BMP": "BMP",
    "GIF": "GIF",
    "WEBP": "WebP",
    "PPM": "PGM",
}


def read_picture(path: str | Path, encoding: str = "srgb") -> Floats:
    """Return the picture as linear light, (rows, columns) float, row 0 at the top.

    Colours count by their luminance, transparent parts are dark.  8 and 16 bit greys keep their depth.

    encoding : "linear", or "srgb" for the curve that the file states in a chunk gAMA or an ICC profile, which
        a note names, else that of sRGB.

    Raises UserError : missing or unreadable file, not a picture, too large, NaN, or black everywhere.
    """
    require_regular_file(path, "the picture")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Pillow's, about parts that are not read
            with Image.open(path, formats=tuple(FORMATS)) as image:
                if image.width * image.height > MAX_SOURCE_PIXELS:
                    raise UserError(_too_large(path, f"{image.width} x {image.height} pixels,"))
                # where a TIFF says that 0 is white Pillow heeds it with up to 8 bits
                inverted = image.mode in DEEP_MODES and getattr(image, "tag_v2", {}).get(PHOTOMETRIC) == 0
                curve = curve_of(image.info, encoding)
                light = _linear(ImageOps.exif_transpose(image), curve.decoded, inverted)
    except (UserError, MemoryError):
        raise
    except UnidentifiedImageError:
        known = ", ".join(FORMATS.values())
        raise UserError(f"{path} is not a picture that can be read; save it as one of {known}") from None
    except Image.DecompressionBombError:
        raise UserError(_too_large(path, "far")) from None
    except OSError as error:
        raise UserError(f"cannot read the picture {path}: {error.strerror or error}; save it again") from None
    except Exception as error:  # a decoder may raise anything on a damaged file
        raise UserError(f"the picture {path} cannot be decoded: {error}; save it again") from None
    if not np.isfinite(light).all():
        raise UserError(f"the picture {path} holds values that are not finite; mend them first")
    if (light < 0).any():
        raise UserError(f"the picture {path} holds negative values; light cannot be negative")
    if not light.any():
        raise UserError(f"the picture {path} is black everywhere; it asks for no light")
    if curve.stated:
        _note_once(
            f"{path}: its numbers are decoded by {curve.stated}, not as sRGB; an editor can save it as sRGB"
        )
    return light


@cache
def _note_once(sentence: str) -> None:
    note(sentence)


def _too_large(path: str | Path, size: str) -> str:
    return (
        f"the picture {path} has {size} more than the {MAX_SOURCE_PIXELS:,} pixels allowed; make it smaller"
    )


def _linear(image: Image.Image, curve: Callable[[Floats], Floats], inverted: bool) -> Floats:
    """Return the light of a picture.  curve : from its numbers to light.  inverted : of its deep numbers 0 is
    white."""
    transparent = image.info.get("transparency")
    if image.mode in DEEP_MODES:
        values = np.asarray(image)
        if values.max() > DEEPEST:
            raise ValueError("its whole numbers have more than 16 bits, which only floating point may have")
        shown = DEEPEST - values if inverted else values
        if values.min() >= 0:
            light = curve(np.arange(DEEPEST + 1) / DEEPEST)[shown]
        else:
            light = curve(shown / DEEPEST)
        return np.where(values == transparent, 0.0, light) if isinstance(transparent, int) else light
    if image.mode == "F":
        return curve(np.asarray(image, dtype=np.float64))
    levels = curve(np.arange(256) / 255)
    if image.mode in ("1", "L") and transparent is None:
        return levels[np.asarray(image.convert("L"))]
    return _luminance(np.asarray(image.convert("RGBA")), levels)


def _luminance(colours: NDArray[np.uint8], levels: Floats) -> Floats:
    """Return the linear light of (rows, columns, 4) colours with transparency, band after band.

    levels : linear light of each of the 256 numbers of a colour.
    """
    light = np.empty(colours.shape[:2])
    step = max(1, BAND_PIXELS // colours.shape[1])
    for row in range(0, len(colours), step):
        band = colours[row : row + step]
        light[row : row + step] = levels[band[..., :3]] @ np.array(LUMINANCE) * (band[..., 3] / 255)
    return light
