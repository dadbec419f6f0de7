"""The density to ask for where light lands beside its place, or is lost, so that the one wanted arrives.

The slopes that would send all light to its place are those of no surface, where light goes far aside.  The
surface with the nearest slopes moves the light that is sent to y on to y + d(y).  This d hardly changes where
light is sent a little elsewhere.  So a map to

    g(y) = T(y + d(y)) det(1 + Dd(y)) / s(y)

brings the density T, where the share s(y) of the light that is sent to y goes on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter, zoom

from thbcad.checks import Floats

CELLS_PER_BIN = 4  # in each direction: d is averaged in bins, since it is smooth but for cracks of the map
CELLS_PER_FINE_BIN = 2
LEAST_SHARE = 0.1  # that is made up for: with less, grazing light would take the light of all else
FEW = 1e-3  # of the mean light of a bin: with less its d is that of the nearest other
SAMPLES = 2  # of a cell in each direction


def prewarped(
    wanted: Floats,
    sent: Sequence[Floats],
    beside: Sequence[Floats],
    light: Floats,
    fine: bool = False,
    share: Floats | None = None,
) -> Floats:
    """Return the density to ask for, (nx, ny), of any scale; T itself where d leads all of it off the target.

    wanted : T, (nx, ny), its cell means over the target.
    sent : two arrays (mx, my), where the light of source cells is sent, the target being [-1, 1]^2.
    beside : two such arrays, d.  light : (mx, my), flux of the source cells.
    fine : d is as uneven as the picture.  share : (mx, my), of the light that goes on; None is all.
    """
    bins = [-(-n // (CELLS_PER_FINE_BIN if fine else CELLS_PER_BIN)) for n in wanted.shape]
    samples = [SAMPLES * n for n in wanted.shape]
    smooth = [
        zoom(d, [m / k for m, k in zip(samples, bins)], order=1, mode="nearest", grid_mode=True)
        for d in _binned(sent, [*beside, *([] if share is None else [share])], light, bins)
    ]
    cells = [d * (n / 2) for d, n in zip(smooth, samples)]
    row, column = (np.floor(d + k + 0.5).astype(int) // SAMPLES for d, k in zip(cells, np.indices(samples)))
    on_target = (row >= 0) & (row < wanted.shape[0]) & (column >= 0) & (column < wanted.shape[1])
    arriving = np.where(on_target, wanted[np.where(on_target, row, 0), np.where(on_target, column, 0)], 0.0)
    (xx, xy), (yx, yy) = (np.gradient(d) for d in cells)
    asked = arriving * np.maximum((1 + xx) * (1 + yy) - xy * yx, 0.0)
    if share is not None:
        asked /= np.maximum(smooth[2], LEAST_SHARE)
    if not asked.any():
        return wanted
    return np.asarray(asked.reshape(wanted.shape[0], SAMPLES, wanted.shape[1], SAMPLES).mean(axis=(1, 3)))


def _binned(
    sent: Sequence[Floats], beside: Sequence[Floats], light: Floats, bins: Sequence[int]
) -> list[Floats]:
    """Return d on bins of the target, where light is sent to and else that of the nearest bin."""
    i, j = (np.clip((t + 1) * (n / 2), 0, n - 1).astype(int) for t, n in zip(sent, bins))
    which = (i * bins[1] + j).ravel()

    def gathered(values: Floats) -> Floats:
        total = np.bincount(which, values.ravel(), bins[0] * bins[1]).reshape(bins)
        return np.asarray(gaussian_filter(total, 1.0, mode="nearest"))

    flux = gathered(light)
    few = flux <= FEW * flux.mean()
    nearest = tuple(distance_transform_edt(few, return_distances=False, return_indices=True))
    return [(gathered(light * d) / np.where(few, 1.0, flux))[nearest] for d in beside]
