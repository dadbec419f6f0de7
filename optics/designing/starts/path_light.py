"""Light laid on grids as mapped cells, so that no projective factor is ever written down.

The light of a source without extent, cut into cells, is traced to a surface of any light path.  A picture is
laid down alike in whatever coordinates transport takes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.ndimage import distance_transform_edt

from optics.base.runtime import Backend, DrArray, UserError
from optics.designing.starts.rear_light import DARK, LEAST_WEIGHT, RearLight, centres
from optics.light.measuring import MappedCells
from optics.light.tracing import Tracer
from optics.scene.paths import LightPath
from optics.scene.receivers import Screen, fit_picture
from optics.scene.sources import LightSource, corner_flux
from thbcad.checks import Floats

ALIKE = 1e-12  # directions that differ by less are one: they need not be laid down
# cells of the source, in each direction, to a cell of the grid: those of a beam all meet the surface
OF_BEAM, OF_CONE = 1, 2


def light_on(
    backend: Backend, path: LightPath, surface: int, source: LightSource, counts: tuple[int, int]
) -> RearLight:
    """Return the light of a source, taken without extent, as it meets a surface of a path, in its own frame.

    counts : (nx, ny) cells over the rectangle of the surface.

    Raises UserError : no light meets it.
    """
    dr, half = backend.dr, path.surfaces[surface].shape.half_width
    each = OF_BEAM if source.beam else OF_CONE
    cells = source.without_extent().cells([each * n for n in counts])
    rays, screen = cells.rays(), Screen(half, counts)
    with dr.suspend_grad():
        hits, along, flux = Tracer(backend, path, rays, proven=False, polarised=False).at(surface)
        mapped = MappedCells(backend, screen, cells.emitted, rays.flux, cells.turned)

        def laid(share: DrArray | float) -> Floats:
            return _picture(screen, mapped(hits.x, hits.y, flux * share, hits.found))

        emitted = laid(1.0)
        if not emitted.any():
            raise UserError(
                "the source that a start is found for, of several the brightest, sends no light to the "
                "surface that is shaped; turn it there by source.tilt, or move it, or make another brighter "
                "by source.weight"
            )
        dark = emitted <= DARK * emitted.mean()
        every = dr.zeros(backend.Float, rays.flux.size)
        ways = [(dr.select(hits.found, backend.Float(d), np.nan) + every).numpy() for d in along[:2]]
        ends = [(np.nanmin(way), np.nanmax(way)) for way in ways]
        if max(high - low for low, high in ends) < ALIKE:
            p, q = (np.full(emitted.shape, (low + high) / 2) for low, high in ends)
        else:
            nearest = tuple(distance_transform_edt(dark, return_distances=False, return_indices=True))
            # means of directions by flux: no light that is laid down may be negative
            shares = [laid((1 + backend.Float(d)) / 2) / np.where(dark, 1.0, emitted) for d in along[:2]]
            p, q = (2 * share[nearest] - 1 for share in shares)
    weight = np.where(dark, LEAST_WEIGHT, np.clip(emitted / emitted.mean(), 2 * LEAST_WEIGHT, 1.0))
    return RearLight(
        *centres(half, counts),
        [p, q, np.sqrt(np.maximum(1 - p * p - q * q, 0.0))],
        resampled(emitted),
        weight,
    )


def picture_on(
    backend: Backend,
    corners: Sequence[Floats],
    light: Floats,
    box: Sequence[tuple[float, float]],
    counts: tuple[int, int],
) -> Floats:
    """Return the light of pixels whose corners lie anywhere on the cells of a rectangle, (nx, ny).

    corners : two arrays (mx + 1, my + 1).  light : (mx, my), flux of the pixels.  box : of the rectangle.
    """
    flux = corner_flux(light)
    (x0, x1), (y0, y1) = box
    screen = Screen(((x1 - x0) / 2, (y1 - y0) / 2), counts)
    x, y = (backend.array((a - (low + high) / 2).ravel()) for a, (low, high) in zip(corners, box))
    with backend.dr.suspend_grad():
        passing = backend.array(flux.ravel())
        return _picture(screen, MappedCells(backend, screen, light, flux)(x, y, passing, passing >= 0))


def resampled(light: Floats) -> Callable[[tuple[int, ...]], Floats]:
    """Return the density that gives means of a grid of cells on other grids over the same rectangle."""
    return lambda grid: fit_picture(light.T, (grid[0], grid[1]), 1.0, "stretch").T


def _picture(screen: Screen, image: DrArray) -> Floats:
    """Return an image as an array of index order x, y; rounding is no negative light."""
    return np.maximum(np.asarray(image.numpy().reshape(screen.shape, order="F")[::-1].T), 0.0)
