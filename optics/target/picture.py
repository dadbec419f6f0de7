"""Pictures as targets: files into linear light on the target's pixels."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from optics.runtime import UserError

LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear sRGB (IEC 61966-2-1)
MAX_SOURCE_PIXELS = 200_000_000
DEEP_MODES = ("I;16", "I;16B", "I;16L", "I")


def read_picture(path: str | Path, encoding: str = "srgb") -> NDArray[np.float64]:
    """Return the picture as linear light, (rows, columns) float, row 0 at the top.

    Colours count by their luminance, transparent parts are dark.  8 and 16 bit greys keep their depth.

    encoding : "srgb" (decoded) or "linear".

    Raises
    ------
    UserError : missing or unreadable file, not a picture, too large, NaN, or black everywhere.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path) as image:
                if image.width * image.height > MAX_SOURCE_PIXELS:
                    size = f"{image.width} x {image.height}"
                    raise UserError(
                        f"{path} has {size} pixels; make it smaller than {MAX_SOURCE_PIXELS} pixels"
                    )
                light = _linear(ImageOps.exif_transpose(image), encoding)
    except (UnidentifiedImageError, Image.DecompressionBombError, SyntaxError, ValueError) as error:
        raise UserError(f"{path} is not a picture that can be read: {error}") from None
    except OSError as error:
        raise UserError(f"cannot read the picture {path}: {error.strerror or error}") from None
    if not np.isfinite(light).all():
        raise UserError(f"the picture {path} holds values that are not finite; mend them first")
    if (light < 0).any():
        raise UserError(f"the picture {path} holds negative values; light cannot be negative")
    if not light.any():
        raise UserError(f"the picture {path} is black everywhere; it asks for no light")
    return light


def fit_picture(
    light: NDArray[np.float64], pixels: tuple[int, int], aspect: float, fit: str = "crop"
) -> NDArray[np.float64]:
    """Return the mean light on each of the target's pixels, (rows, columns).

    pixels : (columns, rows).  aspect : width / height of the target.
    fit : "crop" cuts what does not fit, "pad" adds dark bars, "stretch" distorts.
    """
    rows, columns = light.shape
    if fit != "stretch" and not np.isclose(columns / rows, aspect):
        wide = columns / rows > aspect
        if (fit == "crop") == wide:
            width, height = rows * aspect, float(rows)
        else:
            width, height = float(columns), columns / aspect
    else:
        width, height = float(columns), float(rows)
    by_row = _overlap(rows, height, pixels[1])
    by_column = _overlap(columns, width, pixels[0])
    return by_row @ light @ by_column.T


def _overlap(count: int, extent: float, pixels: int) -> NDArray[np.float64]:
    """Return the fraction of each target pixel that each source pixel covers, (pixels, count).

    `pixels` equal intervals over `extent` source pixels, centred on the row of `count`.
    """
    edges = (count - extent) / 2 + np.linspace(0, extent, pixels + 1)
    source = np.arange(count)
    covered = np.minimum(edges[1:, None], source + 1) - np.maximum(edges[:-1, None], source)
    return np.maximum(covered, 0) / (extent / pixels)


def _linear(image: Image.Image, encoding: str) -> NDArray[np.float64]:
    if image.mode in DEEP_MODES:
        values = np.asarray(image, dtype=np.float64)
        if values.max() > 65535:
            raise ValueError(
                "its whole numbers have more than 16 bits; save it with 16 bits or as floating point"
            )
        return _decoded(values / 65535, encoding)
    if image.mode == "F":
        return _decoded(np.asarray(image, dtype=np.float64), encoding)
    if image.mode == "1" or image.mode == "L":
        return _decoded(np.asarray(image.convert("L"), dtype=np.float64) / 255, encoding)
    values = _decoded(np.asarray(image.convert("RGBA"), dtype=np.float64) / 255, encoding, channels=3)
    return values[..., :3] @ np.array(LUMINANCE) * values[..., 3]


def _decoded(values: NDArray[np.float64], encoding: str, channels: int | None = None) -> NDArray[np.float64]:
    """Undo the sRGB curve (of the first `channels` channels)."""
    if encoding == "linear":
        return values
    colour = values if channels is None else values[..., :channels]
    low = colour <= 0.04045
    decoded = np.where(low, colour / 12.92, ((np.maximum(colour, 0.04045) + 0.055) / 1.055) ** 2.4)
    return decoded if channels is None else np.concatenate([decoded, values[..., channels:]], axis=-1)
