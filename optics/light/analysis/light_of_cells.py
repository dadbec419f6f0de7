"""The light of a lens on box pixels, from cells of the source whose corners are traced.

The map from source to target is smooth but for the rims of the surfaces and total reflection, so that cells
leave an error of second order in their size, and none where the map is linear.  A cell that such a border
cuts is split in four until the parts are as fine as `Borders` says; those of coarser grids stay as much
coarser.  Then those that it cuts are cut along it (`border_triangles`).

Away from borders the error falls with the number N of cells as 1 / N, so that two grids tell it.
Richardson's extrapolation of their images, of N cells and of N / r,

    E = E_N + (E_N - E_N/r) / (r - 1),

leaves how cells lie to the borders of pixels.  A third grid tells the same of half as fine ones, and so the
size of that error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from math import ceil, isqrt, log2, prod, sqrt
from operator import add

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.analysis.border_triangles import FINEST, Borders, border_triangles, shared_flux
from optics.light.analysis.light_estimate import Light, LightEstimate
from optics.light.measuring import MappedCells, Splat
from optics.light.tracing import Landing, SequentialFates, Tracer
from optics.scene.paths import LightPath
from optics.scene.receivers import BoxWindow, Screen
from optics.scene.sources import RayGrid, Rays, SourceCells, corner_flux
from optics.scene.system import System
from thbcad.checks import EPS, Bools, Floats

CORNERS_AT_ONCE = 1 << 19  # more only take more memory
PIXELS_TO_A_CORNER = 2  # of those at once on large screens, whose pixels take time for every strip
# of the finest grid, in each direction: rel_l2 is within 4e-5 of that of 6143 cells on ten examples, within
# 6e-4 on pictures that are mostly black or of few greys
CELLS_PER_PIXEL, CELLS_PER_SPAN = 4, 4
MORE_PER_PIXEL, CHEAP = 10, 1024  # where that is not more in all: folds err by 0.3 % at most in each pixel
LEAST_CELLS = 256
COARSER = 2  # from one grid to the next
ORDER = 1.22  # of the error of extrapolated light in the number of cells: measured
LEAST_PER_PIXEL, MOST_CELLS = 3, 2048  # in each direction, on large screens: per pixel, or in all

Trace = Callable[["RayGrid | Rays"], tuple[Tracer, "Landing"]]


@dataclass(frozen=True, eq=False)
class _Light:
    """Irradiance of all screens, flat as Dr.Jit has it, flux by fate, and cells that are cut, (nx, ny)."""

    images: Floats
    fates: SequentialFates
    cut: Bools


def cut_cells(arrives: Bools, emitted: Floats, least: float = 0.0) -> Bools:
    """Return which cells that emit more than `least`, W, have corners that arrive and others that do not."""
    nx, ny = emitted.shape
    seen = arrives.astype(np.int8).reshape(nx + 1, ny + 1)
    corners = seen[1:, 1:] + seen[1:, :-1] + seen[:-1, 1:] + seen[:-1, :-1]
    return (corners > 0) & (corners < 4) & (emitted > least)


@dataclass(frozen=True, eq=False)
class _CellTracer:
    """Cells are traced with their corners, to screens."""

    trace: Trace
    screens: Sequence[Screen]
    backend: Backend
    borders: Borders

    def light(
        self, rays: RayGrid | Rays, emitted: Floats, turned: Bools | None = None, least: float = 0.0
    ) -> _Light:
        """Return the light of cells that are not cut, from the rays at their corners.

        turned : as of `MappedCells`.  least : W, a cell with no more is not worth its cut.
        """
        tracer, landing, arrives = self._trace(rays)
        cut, weights = cut_cells(arrives.numpy(), emitted, least), None
        if cut.any():
            emitted = np.where(cut, 0.0, emitted)
            whole, every = corner_flux(emitted).ravel(), rays.flux.ravel()
            weights = self.backend.array(np.divide(whole, every, out=np.zeros_like(every), where=every > 0))
        images = []
        with self.backend.dr.suspend_grad():
            for screen in self.screens:
                cells = MappedCells(self.backend, screen, emitted, rays.flux, turned)
                images.append(cells(landing.x, landing.y, landing.flux, arrives).numpy())
        fates = tracer.fates(landing, self.screens[0].half_width, weights)
        return _Light(np.concatenate(images), fates, cut)

    def points(self, rays: Rays) -> _Light:
        """Return the light of rays where they land."""
        tracer, landing, _ = self._trace(rays)
        with self.backend.dr.suspend_grad():
            images = [
                Splat(self.backend, screen, BoxWindow())(landing.x, landing.y, landing.flux).numpy()
                for screen in self.screens
            ]
        fates = tracer.fates(landing, self.screens[0].half_width)
        return _Light(np.concatenate(images), fates, np.zeros((0, 0), dtype=bool))

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


def grid_irradiance(
    system: System, path: LightPath, screen: Screen, backend: Backend, boxes: Screen | None = None
) -> tuple[LightEstimate, SequentialFates]:
    """Return (extrapolated irradiance along a path, flux by fate of the finest grid).

    boxes : a second screen, on which the same light is measured.
    """
    spans = [0, 0]
    for sag in path.sags:
        embedding = sag.space.embedding
        spans = [max(n, kv.dim - kv.degree) for n, kv in zip(spans, (embedding.kv_u, embedding.kv_v))]
    counts = [_cells(*pair) for pair in zip(screen.pixels, spans)]
    grids = [_grid([n / COARSER**k for n in counts], system.source.kinked) for k in range(3)]
    screens = [screen] if boxes is None else [screen, boxes]
    traced = [
        images_of_cells(path, screens, system.source.cells(grid), backend, FINEST.coarser(COARSER**k))
        for k, grid in enumerate(grids)
    ]
    every, (fates, coarse, _) = zip(*traced)
    ratios = [prod(finer) / prod(grid) for finer, grid in pairwise(grids)]
    lights, drifts = [], []
    for k, images in enumerate(zip(*every)):
        pairs = zip(pairwise(images), ratios)
        finest, coarser = (extrapolated(*pair, ratio, keeps_flux=k == 0) for pair, ratio in pairs)
        lights.append(finest)
        drifts.append((finest - coarser) / _excess(ratios[0] ** ORDER))
    # fluxes are not extrapolated: light keeps them
    changes = coarse.on_target - fates.on_target, coarse.off_target - fates.off_target
    on, off = (change / (ratios[0] - 1) for change in changes)
    light = Light.of(lights, fates.on_target, fates.off_target)
    return LightEstimate.exact(light, Light.of(drifts, on, off)), fates


def _grid(counts: Sequence[float], kinked: bool) -> list[int]:
    """Return the cells of a grid in each direction: they share no lines with others but borders and middles.

    counts : of cells in each direction, about.  kinked : as of `LightSource`.
    """
    if kinked:
        return 2 * [2 * _prime_from(round(sqrt(prod(counts)) / 2))]
    return [_prime_from(round(n)) for n in counts]


def _cells(pixels: int, spans: int) -> int:
    """Return about how many cells the finest grid has in a direction.  spans : of the knots of a sag."""
    cheap = max(LEAST_CELLS, min(MORE_PER_PIXEL * pixels, CHEAP))
    most = max(LEAST_PER_PIXEL * pixels, MOST_CELLS)
    return min(max(cheap, CELLS_PER_PIXEL * pixels, CELLS_PER_SPAN * spans), most)


def extrapolated(fine: Floats, coarse: Floats, ratio: float, keeps_flux: bool = True) -> Floats:
    """Return Richardson's extrapolation of two grids' images, nowhere negative, with the flux of the finer.

    ratio : of the numbers of their cells.  keeps_flux : of an image from whose screen no light is cut off.
    """
    light = np.maximum(fine + (fine - coarse) / (ratio - 1), 0.0)
    return light * (fine.sum() / (light.sum() or 1.0)) if keeps_flux else light


def _excess(ratio: float) -> float:
    """Return how large the difference of two images is, in errors of the better one.

    ratio : of their errors.  Errors that have the same form leave ratio - 1, independent ones
    sqrt(ratio^2 + 1), and cells of a lens something between: their mean in proportion.  For a ratio of 5 both
    are 13 % away.
    """
    return sqrt((ratio - 1) * sqrt(ratio**2 + 1))


def _prime_from(least: int) -> int:
    """Return the least prime from `least` on: grids of different primes share no lines but their borders."""
    n = least
    while any(n % k == 0 for k in range(2, isqrt(n) + 1)):
        n += 1
    return n


def cell_irradiance(
    path: LightPath,
    screen: Screen,
    cells: SourceCells,
    backend: Backend,
    borders: Borders = FINEST,
) -> tuple[Floats, SequentialFates]:
    """Return (irradiance (rows, columns) W/mm^2, flux by fate) of the light of cells along a path.

    backend : of double precision.
    """
    (image,), fates = images_of_cells(path, [screen], cells, backend, borders)
    return image, fates


def images_of_cells(
    path: LightPath,
    screens: Sequence[Screen],
    cells: SourceCells,
    backend: Backend,
    borders: Borders = FINEST,
) -> tuple[list[Floats], SequentialFates]:
    """Return the irradiance of several screens, and the flux by fate on the first, see `cell_irradiance`."""
    of_points: Tracer | None = None

    def trace(rays: RayGrid | Rays) -> tuple[Tracer, Landing]:
        nonlocal of_points
        if isinstance(rays, RayGrid):
            tracer = Tracer(backend, path, rays)
        else:
            tracer = of_points.with_rays(rays) if of_points else Tracer(backend, path, rays)
            of_points = tracer
        return tracer, tracer.landed()

    return traced_cells(trace, screens, cells, backend, borders=borders)


def traced_cells(
    trace: Trace,
    screens: Sequence[Screen],
    cells: SourceCells,
    backend: Backend,
    at_once: int | None = None,
    borders: Borders = FINEST,
) -> tuple[list[Floats], SequentialFates]:
    """Return what `images_of_cells` does, of light that is traced in any way.

    trace : called with rays, returns their Tracer, which knows the fates, and the Landing on the receiver.
    at_once : corners that are in memory together, about; None leaves it to the program.
    """
    tracer = _CellTracer(trace, screens, backend, borders)
    rounding = EPS * float(cells.emitted.sum())  # what exact shares of a round beam leave beside it
    parts, pieces = [], []
    usual = max(CORNERS_AT_ONCE, prod(screens[0].pixels) // PIXELS_TO_A_CORNER)
    for strip in cells.slices(at_once or usual):
        part = tracer.light(strip.rays(), strip.emitted, strip.turned, rounding)
        parts.append(part)
        i, j = np.nonzero(part.cut)
        pieces.append(np.stack([strip.s[i], strip.s[i + 1], strip.t[j], strip.t[j + 1], strip.emitted[i, j]]))
    rest = np.concatenate(pieces, axis=1)
    splits = ceil(log2(borders.cells / min(cells.emitted.shape)))
    while rest.size and splits > 0:
        splits -= 1
        part, rest = _split(tracer, cells, rest)
        parts.append(part)
    if rest.size:
        parts.extend(_along_border(tracer, cells, rest))
    flat = reduce(add, (part.images for part in parts))
    ends = np.cumsum([prod(screen.pixels) for screen in screens])
    images = [one.reshape(screen.shape, order="F") for one, screen in zip(np.split(flat, ends[:-1]), screens)]
    fates = reduce(add, (part.fates for part in parts))
    on_target = min(float(images[0].sum()) * screens[0].pixel_area, fates.transmitted)
    return images, fates.landing(on_target, fates.transmitted - on_target)


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
    turned = cells.turned_at(*(np.repeat(v, 6).reshape(-1, 2)[:-1] for v in (s0 + s1, t0 + t1)))
    part = tracer.light(cells.at(rows, columns, corner_flux(emitted).ravel()), emitted, turned)
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

    (p, q, r), flux = border_triangles(pieces, arrive, cells.density, tracer.borders.bisections)
    s, t = np.stack([p, q, r, (q + r) / 2]).transpose(1, 2, 0)
    emitted = np.zeros((2 * len(flux) - 1, 1))
    emitted[::2, 0] = flux
    part = tracer.light(cells.at(s.ravel(), t.ravel(), corner_flux(emitted).ravel()), emitted)
    left = part.cut[::2, 0]
    if not left.any():
        return [part]
    quarters = np.repeat(flux[left] / 4, 4)
    return [part, tracer.points(cells.at(s[left].ravel(), t[left].ravel(), quarters))]
