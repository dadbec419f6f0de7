"""Pictures as targets: linear light of any size on the target's pixels."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.sparse import csr_array

from thbcad.checks import Floats

BAND = 64  # rows that are turned together: those of large pictures do not fit into the processor's cache


def fit_picture(light: Floats, pixels: tuple[int, int], aspect: float, fit: str = "crop") -> Floats:
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
    if (columns, rows) == (width, height) == pixels:
        return light
    by_row, by_column = _overlap(rows, height, pixels[1]), _overlap(columns, width, pixels[0])
    fitted, by_rows = np.empty(pixels[::-1]), by_row @ light
    for start in range(0, pixels[1], BAND):
        fitted[start : start + BAND] = (by_column @ by_rows[start : start + BAND].T).T
    return fitted


def merged(image: Floats, parts: int) -> Floats:
    """Return the means of an image over pixels of parts x parts of its own."""
    total = sum(image[row::parts, column::parts] for row, column in np.ndindex(parts, parts))
    return np.asarray(total / parts**2)


def divided(light: Floats, parts: int) -> Floats:
    """Return pixels' light in parts x parts of each, (parts rows, parts columns), whose means are that light.

    It is the slope of its sums, a monotone cubic interpolation along one axis and then the other: smooth
    light goes on smoothly, and none is negative.
    """
    for axis, count in enumerate(light.shape):
        sums = np.insert(np.cumsum(light, axis=axis), 0, 0.0, axis=axis)
        ends = np.arange(parts * count + 1) / parts
        light = parts * np.diff(PchipInterpolator(np.arange(count + 1), sums, axis=axis)(ends), axis=axis)
    return light


def _overlap(count: int, extent: float, pixels: int) -> csr_array:
    """Return the fraction of each target pixel that each source pixel covers, (pixels, count).

    `pixels` equal intervals over `extent` source pixels, centred on the row of `count`.
    """
    edges = (count - extent) / 2 + np.linspace(0, extent, pixels + 1)
    first = np.clip(np.floor(edges[:-1]), 0, count - 1).astype(np.int64)
    width = int(np.ceil(extent / pixels)) + 1  # source pixels that an interval can touch
    source = first[:, None] + np.arange(width)
    covered = np.minimum(edges[1:, None], source + 1) - np.maximum(edges[:-1, None], source)
    hit = (covered > 0) & (source < count)
    target = np.nonzero(hit)[0]
    return csr_array((covered[hit] / (extent / pixels), (target, source[hit])), shape=(pixels, count))
