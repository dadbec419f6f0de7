"""Measured height fields, rows of pixels, as samples."""

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats, require_real
from thbcad.fitting.least_squares_fit import Samples


def height_field_samples(
    heights: ArrayLike, x: ArrayLike, y: ArrayLike, missing: ArrayLike | None = None
) -> Samples:
    """Return the samples of a height field: heights[r, c] lies at u = x[c], v = y[r].

    Columns run along x and rows along y, in any direction: where row 0 is at the greatest y, as in an image,
    y falls.  The centres of rows x columns pixels over |x| <= hx, |y| <= hy are

        x[c] = -hx + (c + 1/2) 2 hx / columns,   y[r] = hy - (r + 1/2) 2 hy / rows.

    Heights that are NaN, masked (`numpy.ma`) or True in `missing` are left out.  `Samples.grid` takes arrays
    whose first index runs along u instead.

    heights : (rows, columns) float.  x : (columns,) and y : (rows,) float, strictly rising or falling.
    missing : (rows, columns) bool.

    Raises ValueError : shapes that do not agree, x or y that turn or repeat, heights that are infinite, no
        height that is left.
    """
    x, y = (_axis(name, values) for name, values in (("x", x), ("y", y)))
    masked: np.ma.MaskedArray = np.ma.asarray(heights)
    require_real(masked.data)
    gaps, field = np.ma.getmaskarray(masked), np.array(masked.data, dtype=np.float64)
    if field.shape != (len(y), len(x)):
        raise ValueError(
            f"a height field with {len(y)} rows y and {len(x)} columns x needs heights ({len(y)}, {len(x)}), "
            f"got shape {field.shape}"
        )
    if missing is not None:
        missing = np.asarray(missing)
        if missing.dtype != bool or missing.shape != field.shape:
            raise ValueError(
                f"missing must be bool of shape {field.shape}, got {missing.dtype} of shape {missing.shape}"
            )
        gaps = gaps | missing
    row, column = np.nonzero(~gaps & ~np.isnan(field))
    if not len(row):
        raise ValueError(f"none of the {field.size} heights is left: all are NaN, masked or missing")
    return Samples(x[column], y[row], field[row, column])


def _axis(name: str, values: ArrayLike) -> Floats:
    """Return the coordinates of columns or rows; refuse those that turn or repeat."""
    require_real(values)
    out = np.asarray(values, dtype=np.float64)
    steps = np.diff(out)
    if out.ndim != 1 or not np.isfinite(out).all() or not ((steps > 0).all() or (steps < 0).all()):
        raise ValueError(f"{name} must be a row of finite numbers that strictly rises or falls")
    return out
