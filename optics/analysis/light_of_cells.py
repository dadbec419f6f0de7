"""The light of a lens on box pixels, from cells of the source whose corners are traced.

The map from source to target is smooth but for the rims of the surfaces and total reflection, so that cells
leave an error of second order in their size, and none where the map is linear.  A cell that such a border
cuts is split in four, SPLITS times; what is still cut then counts where its corners land.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from operator import add
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.sources import corner_flux
from optics.target import BoxWindow, MappedCells, Splat
from optics.tracing import Tracer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from optics.runtime import Backend
    from optics.sources import RayGrid, Rays, SourceCells
    from optics.system import OpticalSystem
    from optics.target import Screen
    from optics.tracing import SequentialFates
    from thbcad.lens import Lens

CORNERS_AT_ONCE = 1 << 19  # more only take more memory
SPLITS = 6

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Light:
    """Irradiance, flat as Dr.Jit has it, flux by fate, and which cells are cut, (nx, ny) bool."""

    image: Floats
    fates: SequentialFates
    cut: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _CellTracer:
    """A lens that cells are traced through, to a screen."""

    system: OpticalSystem
    lens: Lens
    screen: Screen
    backend: Backend

    def light(self, rays: RayGrid | Rays, emitted: Floats) -> _Light:
        """Return the light of cells that are not cut, from the rays at their corners."""
        tracer = Tracer(self.backend, self.lens, rays, self.system.target.z)
        dr = self.backend.dr
        with dr.suspend_grad():
            _, landing = tracer.trace([sag.coefficients for sag in self.lens.sags])
            arrives = landing.definite & landing.met & landing.hit
            sound = dr.select(arrives, self.backend.Float(1), 0) + dr.zeros(
                self.backend.Float, rays.flux.size
            )
            seen = sound.numpy().reshape([n + 1 for n in emitted.shape])
            corners = seen[1:, 1:] + seen[1:, :-1] + seen[:-1, 1:] + seen[:-1, :-1]
            cut = (corners > 0) & (corners < 4) & (emitted > 0)
            if cut.any():
                whole = np.where(cut, 0.0, emitted)
                flux = corner_flux(whole).reshape(rays.flux.shape)
                return replace(self.light(replace(rays, flux=flux), whole), cut=cut)
            cells = MappedCells(self.backend, self.screen, emitted, rays.flux)
            image = cells(landing.x, landing.y, landing.flux, sound > 0).numpy()
        return _Light(image, tracer.fates(landing, self.screen.half_width), cut)

    def points(self, rays: Rays) -> _Light:
        """Return the light of rays where they land."""
        tracer = Tracer(self.backend, self.lens, rays, self.system.target.z)
        with self.backend.dr.suspend_grad():
            _, landing = tracer.trace([sag.coefficients for sag in self.lens.sags])
            image = Splat(self.backend, self.screen, BoxWindow())(landing.x, landing.y, landing.flux).numpy()
        return _Light(image, tracer.fates(landing, self.screen.half_width), np.zeros((0, 0), dtype=bool))


def cell_irradiance(
    system: OpticalSystem, lens: Lens, screen: Screen, counts: Sequence[int], backend: Backend
) -> tuple[Floats, SequentialFates]:
    """Return (irradiance (rows, columns) W/mm^2, flux by fate) of the light of (nx, ny) cells.

    backend : of double precision.
    """
    cells, tracer = system.source.cells(counts), _CellTracer(system, lens, screen, backend)
    parts, pieces = [], []
    for strip in cells.slices(CORNERS_AT_ONCE):
        part = tracer.light(strip.rays(), strip.emitted)
        parts.append(part)
        pieces.append(_pieces(strip, part.cut))
    rest = np.concatenate(pieces, axis=1)
    for _ in range(SPLITS):
        if rest.size == 0:
            break
        part, rest = _split(tracer, cells, rest)
        parts.append(part)
    if rest.size:
        parts.append(tracer.points(_corners(cells, rest)))
    image = reduce(add, (part.image for part in parts)).reshape(screen.shape, order="F")
    fates = reduce(add, (part.fates for part in parts))
    on_target = min(float(image.sum()) * screen.pixel_area, fates.transmitted)
    return image, replace(fates, on_target=on_target, off_target=fates.transmitted - on_target)


def _pieces(strip: SourceCells, cut: NDArray[np.bool_]) -> Floats:
    """Return s and t of the lower and the upper corner of cells, and their flux: rows of (5, n)."""
    i, j = np.nonzero(cut)
    return np.stack([strip.s[i], strip.s[i + 1], strip.t[j], strip.t[j + 1], strip.emitted[i, j]])


def _split(tracer: _CellTracer, cells: SourceCells, pieces: Floats) -> tuple[_Light, Floats]:
    """Return the light of the quarters of pieces, and those quarters that are cut.

    The corners of all pieces, 3 x 3 each, are stacked as one grid; the cells between pieces are dark.
    """
    s0, s1, t0, t1, flux = pieces
    s, t = np.stack([s0, (s0 + s1) / 2, s1], axis=1), np.stack([t0, (t0 + t1) / 2, t1], axis=1)
    emitted = np.zeros((3 * len(flux), 2))
    for row in (0, 1):
        emitted[row::3] = flux[:, None] / 4
    emitted = emitted[:-1]
    rows, columns = np.repeat(s.ravel(), 3), np.repeat(t, 3, axis=0).ravel()
    part = tracer.light(cells.at(rows, columns, corner_flux(emitted).ravel()), emitted)
    i, j = np.nonzero(part.cut)
    piece, low = i // 3, i % 3
    cut = [s[piece, low], s[piece, low + 1], t[piece, j], t[piece, j + 1], flux[piece] / 4]
    return part, np.stack(cut)


def _corners(cells: SourceCells, pieces: Floats) -> Rays:
    """Return rays at the four corners of pieces, each with a quarter of their flux."""
    s0, s1, t0, t1, flux = pieces
    return cells.at(np.concatenate([s0, s0, s1, s1]), np.concatenate([t0, t1, t0, t1]), np.tile(flux / 4, 4))
