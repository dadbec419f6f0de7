"""The light of a lens on box pixels, from cells of the source whose corners are traced.

The map from source to target is smooth but for the rims of the surfaces and total reflection, so that cells
leave an error of second order in their size, and none where the map is linear.  A cell that such a border
cuts is split in four until 1 / BORDER_CELLS of the source is wider than the parts.  Then those that it cuts
are cut along it (`border_triangles`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce
from math import ceil, log2
from operator import add

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.analysis.border_triangles import BISECTIONS, border_triangles, shared_flux
from optics.light.measuring import MappedCells, Splat
from optics.light.tracing import Landing, SequentialFates, Tracer
from optics.scene.paths import LightPath
from optics.scene.receivers import BoxWindow, Screen
from optics.scene.sources import RayGrid, Rays, SourceCells, corner_flux
from thbcad.checks import EPS, Bools, Floats

CORNERS_AT_ONCE = 1 << 19  # more only take more memory
BORDER_CELLS = (
    2000  # across the source; its square times 4 is more than all light beside a rim's four corners
)

Trace = Callable[["RayGrid | Rays"], tuple[Tracer, "Landing"]]


@dataclass(frozen=True, eq=False)
class _Light:
    """Irradiance, flat as Dr.Jit has it, flux by fate, and which cells are cut, (nx, ny) bool."""

    image: Floats
    fates: SequentialFates
    cut: Bools


@dataclass(frozen=True, eq=False)
class _CellTracer:
    """Cells are traced with their corners, to a screen.  bisections : see `border_triangles`."""

    trace: Trace
    screen: Screen
    backend: Backend
    bisections: int

    def light(self, rays: RayGrid | Rays, emitted: Floats, least: float = 0.0) -> _Light:
        """Return the light of cells that are not cut, from the rays at their corners.

        least : W, a cell with no more is not worth its cut.
        """
        tracer, landing, arrives = self._trace(rays)
        nx, ny = emitted.shape
        seen = arrives.numpy().astype(np.int8).reshape(nx + 1, ny + 1)
        corners = seen[1:, 1:] + seen[1:, :-1] + seen[:-1, 1:] + seen[:-1, :-1]
        cut = (corners > 0) & (corners < 4) & (emitted > least)
        if cut.any():
            whole = np.where(cut, 0.0, emitted)
            flux = corner_flux(whole).reshape(rays.flux.shape)
            return replace(self.light(replace(rays, flux=flux), whole), cut=cut)
        cells = MappedCells(self.backend, self.screen, emitted, rays.flux)
        with self.backend.dr.suspend_grad():
            image = cells(landing.x, landing.y, landing.flux, arrives).numpy()
        return _Light(image, tracer.fates(landing, self.screen.half_width), cut)

    def points(self, rays: Rays) -> _Light:
        """Return the light of rays where they land."""
        tracer, landing, _ = self._trace(rays)
        with self.backend.dr.suspend_grad():
            image = Splat(self.backend, self.screen, BoxWindow())(landing.x, landing.y, landing.flux).numpy()
        return _Light(image, tracer.fates(landing, self.screen.half_width), np.zeros((0, 0), dtype=bool))

    def arrive(self, rays: Rays) -> Bools:
        """Return which rays arrive, (n,)."""
        _, _, arrives = self._trace(rays)
        return arrives.numpy()

    def _trace(self, rays: RayGrid | Rays) -> tuple[Tracer, Landing, DrArray]:
        """Return the tracer of rays, their Landing, and which of them arrive."""
        dr = self.backend.dr
        tracer, landing = self.trace(rays)
        every = dr.ones(dr.mask_t(self.backend.Float), rays.flux.size)
        return tracer, landing, every & landing.arrives


def cell_irradiance(
    path: LightPath, screen: Screen, cells: SourceCells, backend: Backend, bisections: int = BISECTIONS
) -> tuple[Floats, SequentialFates]:
    """Return (irradiance (rows, columns) W/mm^2, flux by fate) of the light of cells along a path.

    backend : of double precision.  bisections : see `border_triangles`.
    """

    def trace(rays: RayGrid | Rays) -> tuple[Tracer, Landing]:
        tracer = Tracer(backend, path, rays)
        with backend.dr.suspend_grad():
            _, landing = tracer.trace()
        return tracer, landing

    return traced_cells(trace, screen, cells, backend, bisections=bisections)


def traced_cells(
    trace: Trace,
    screen: Screen,
    cells: SourceCells,
    backend: Backend,
    at_once: int = CORNERS_AT_ONCE,
    bisections: int = BISECTIONS,
) -> tuple[Floats, SequentialFates]:
    """Return what `cell_irradiance` does, of light that is traced in any way.

    trace : called with rays, returns their Tracer, which knows the fates, and the Landing on the screen.
    at_once : corners that are in memory together, about.
    bisections : see `border_triangles`.
    """
    tracer = _CellTracer(trace, screen, backend, bisections)
    rounding = EPS * float(cells.emitted.sum())  # what exact shares of a round beam leave beside it
    parts, pieces = [], []
    for strip in cells.slices(at_once):
        part = tracer.light(strip.rays(), strip.emitted, rounding)
        parts.append(part)
        i, j = np.nonzero(part.cut)
        pieces.append(np.stack([strip.s[i], strip.s[i + 1], strip.t[j], strip.t[j + 1], strip.emitted[i, j]]))
    rest = np.concatenate(pieces, axis=1)
    splits = ceil(log2(BORDER_CELLS / min(cells.emitted.shape)))
    while rest.size and splits > 0:
        splits -= 1
        part, rest = _split(tracer, cells, rest)
        parts.append(part)
    if rest.size:
        parts.extend(_along_border(tracer, cells, rest))
    image = reduce(add, (part.image for part in parts)).reshape(screen.shape, order="F")
    fates = reduce(add, (part.fates for part in parts))
    on_target = min(float(image.sum()) * screen.pixel_area, fates.transmitted)
    return image, fates.landing(on_target, fates.transmitted - on_target)


def _split(tracer: _CellTracer, cells: SourceCells, pieces: Floats) -> tuple[_Light, Floats]:
    """Return the light of the quarters of pieces, and those quarters that are cut.

    The corners of all pieces, 3 x 3 each, are stacked as one grid; the cells between pieces are dark.
    """
    s0, s1, t0, t1, flux = pieces
    s, t = np.stack([s0, (s0 + s1) / 2, s1]), np.stack([t0, (t0 + t1) / 2, t1])
    middles = np.stack([np.repeat(s[1:] + s[:-1], 2, axis=0), np.tile(t[1:] + t[:-1], (2, 1))]) / 2
    shared = shared_flux(flux, np.ones((4, len(flux))), middles, cells.density).reshape(2, 2, -1)
    emitted = np.zeros((len(flux), 3, 2))
    emitted[:, :2] = shared.transpose(2, 0, 1)
    emitted = emitted.reshape(-1, 2)[:-1]
    rows, columns = np.repeat(s.T.ravel(), 3), np.repeat(t.T, 3, axis=0).ravel()
    part = tracer.light(cells.at(rows, columns, corner_flux(emitted).ravel()), emitted)
    i, j = np.nonzero(part.cut)
    piece, row = i // 3, i % 3
    cut = [s[row, piece], s[row + 1, piece], t[j, piece], t[j + 1, piece], emitted[i, j]]
    return part, np.stack(cut)


def _along_border(tracer: _CellTracer, cells: SourceCells, pieces: Floats) -> list[_Light]:
    """Return the light of pieces that are cut, cut along the border.

    A median makes two triangles of the same flux of each part, which are those of one cell.  Where the
    border is so bent that it parts a median's foot from the corners, the corners count where they land.
    """

    def arrive(s: Floats, t: Floats) -> Bools:
        return tracer.arrive(cells.at(s, t, np.zeros_like(s)))

    (p, q, r), flux = border_triangles(pieces, arrive, cells.density, tracer.bisections)
    s, t = np.stack([p, q, r, (q + r) / 2]).transpose(1, 2, 0)
    emitted = np.zeros((2 * len(flux) - 1, 1))
    emitted[::2, 0] = flux
    part = tracer.light(cells.at(s.ravel(), t.ravel(), corner_flux(emitted).ravel()), emitted)
    left = part.cut[::2, 0]
    if not left.any():
        return [part]
    quarters = np.repeat(flux[left] / 4, 4)
    return [part, tracer.points(cells.at(s[left].ravel(), t[left].ravel(), quarters))]
