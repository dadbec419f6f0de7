"""The light that meets the surface that a transport map shapes, mostly the rear, on a grid of cells."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from optics.base.runtime import Backend
from optics.light.measuring import Splat
from optics.light.refraction import FixedRear, ShapedFront, ShapedRear
from optics.light.tracing import Tracer
from optics.scene.receivers import BSplineWindow, Screen
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens
from thbcad.outlines import Outline

RAYS_PER_CELL = 4  # in each direction
DARK = 1e-3  # of the greatest irradiance: nothing is sent there
LEAST_WEIGHT = 1e-3  # of cells without light
EVEN = 32  # cells across an outline are a multiple of it: grids are halved, and cosine transforms are fast

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RearLight:
    """Light of one direction at every point of the rear, or of a front that alone is free, in cells.

    x, y : (nx,), (ny,) cell centres, mm.  direction : three arrays (nx, ny), unit vectors before the surface.
    emitted : called with (nx, ny), returns the density of flux on such a grid.  weight : (nx, ny), of the
        slopes in a fit.
    """

    x: Floats
    y: Floats
    direction: Sequence[Floats]
    emitted: Callable[[tuple[int, ...]], Floats]
    weight: Floats


def traced_light(backend: Backend, system: OpticalSystem, lens: Lens, cells: Sequence[int]) -> RearLight:
    """Return the light of the system's source, taken without extent, as it meets the shaped surface."""
    half = getattr(lens, system.shaped).half_width
    rays = system.source.without_extent().rays([RAYS_PER_CELL * n + 1 for n in cells])
    with backend.dr.suspend_grad():
        tracer = Tracer(backend, system.path(lens), rays)
        hits, direction, flux = tracer.at(("front", "rear").index(system.shaped))

    def density(grid: Sequence[int], carried: object) -> Floats:
        screen = Screen(half, (grid[0], grid[1]))
        image = Splat(backend, screen, BSplineWindow(2))(hits.x, hits.y, carried).numpy()
        return image.reshape(screen.shape, order="F")[::-1].T

    emitted = density(cells, flux)
    dark = emitted <= DARK * emitted.mean()
    nearest = tuple(distance_transform_edt(dark, return_distances=False, return_indices=True))
    mean = [(density(cells, flux * d) / np.where(dark, 1.0, emitted))[nearest] for d in direction]
    weight = np.where(dark, 0.0, np.minimum(emitted / emitted.mean(), 1.0))
    return RearLight(
        *centres(half, cells),
        mean,
        lambda grid: density(grid, flux),
        np.maximum(weight, LEAST_WEIGHT),
    )


def refraction_of(system: OpticalSystem) -> ShapedRear | ShapedFront:
    """Return how the surface that a transport map shapes sends light to the target."""
    lens, receiver = system.lens, system.target.receiver
    if system.shaped == "rear":
        return ShapedRear(lens.index, receiver)
    return ShapedFront(FixedRear(lens.index, lens.rear.conic, lens.thickness, receiver))


def centres(half: Sequence[float], cells: Sequence[int]) -> tuple[Floats, Floats]:
    """Return x and y of the centres of (nx, ny) cells of a rectangle around 0 with these half-widths."""
    x, y = (h * ((2 * np.arange(n) + 1) / n - 1) for h, n in zip(half, cells))
    return x, y


def as_many_within(outline: Outline, cells: int) -> int:
    """Return the cells across an outline with which as many lie within as in its rectangle, about."""
    if outline.is_rectangle:
        return cells
    whole = 4 * float(np.prod(outline.half_width))
    return EVEN * round(cells * np.sqrt(whole / outline.area) / EVEN)


def inside(outlines: Iterable[Outline], half: Sequence[float], counts: Sequence[int]) -> Floats:
    """Return the share of every cell of a rectangle with these half-widths that lies in all outlines."""
    x, y = (h * (2 * np.arange(n + 1) / n - 1) for h, n in zip(half, counts))
    x = x[:, None]
    shares = [o.shares((x[:-1], y[:-1]), (x[1:], y[1:])) for o in outlines if not o.is_rectangle]
    return np.minimum.reduce([np.ones((counts[0], counts[1])), *shares])
