"""Where the light between a lens and its target is concentrated most.

Without losses every ray keeps its flux.  Behind the rear it is straight, so that it meets the plane at z in
x(z) = x + (z - z0) tan u.  The irradiance of sharp light is infinite on caustics.  What counts is its mean
over a disk of the diameter

    d = max(1 mm, 2 s tan a, what RAYS_IN_DISK take),    pi sin^2 a = 1 / b,

with the way s from the rear and the greatest radiance b of a diverging beam, by flux and area: a disk that is
as bright everywhere has the half-angle a.  Light of a point of the rear is such a disk on the plane, so that
the mean of sharp light over it is the irradiance of the blurred light.  Sharp light is traced by the corners
of its cells, and other light by rays as they are.

The concentration is that mean over the irradiance of the front, its own mean over what is lit of it.
Sunlight of 1 kW/m^2 is concentrated to as many kW/m^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import inf, isinf, isqrt, pi, sqrt

import numpy as np
from scipy.ndimage import convolve
from scipy.optimize import minimize_scalar
from scipy.spatial import ConvexHull

from optics.base.runtime import Backend, UserError
from optics.light.tracing import Tracer
from optics.scene.receivers import Plane
from optics.scene.sources import SourceCells
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats, Integers
from thbcad.lens import Lens

SMALLEST_DISK = 1.0  # mm: heat spreads from smaller ones before paper or wood burns
CELLS = 512  # of sharp light in each direction; their square is the number of rays of other light
COARSER = 2  # cells in each direction, with which planes are looked at before the last one
RAYS_IN_DISK = 16, 400  # at the irradiance of the front: cells, and rays at random, whose noise is 5 %
PARTS, MOST_PARTS = 4, 1 << 16  # of a cell in each direction; of all cells, where they are not more
FAR = 10_000.0  # mm behind the rear, as far as light to the far field is followed
PLANES, CLOSER = 48, 12  # looked at, close together near the rear; steps around the two best of them
LEAST_RAYS = 4  # on the front, that tell how much of it is lit
ACROSS = 6  # bins across a disk
WIDER = 1.01  # blocks over a disk, from which on they are cut again
BLOCKS = 512  # of the light in each direction, at most
SEARCHED, SEARCHED_LAST = 4, 64  # of these, the brightest, for disks; on the plane that is found
SUNLIGHT = 1.0  # kW/m^2, across the beam


@dataclass(frozen=True)
class Concentration:
    """The greatest concentration of light on a plane between lens and target, across the way to its middle.

    times : the mean irradiance on a disk, over that of the beam, or of the first face.
    irradiance : on that disk, of the source's own flux, W/mm^2 (lm/mm^2), without losses
    sunlight : kW/m^2 on it where the sun shines along a beam's axis; None of sources that are no beams
    behind : mm from the rear vertex to the plane.  disk : mm, its diameter.  searched : mm behind that vertex
    """

    times: float
    irradiance: float
    sunlight: float | None
    behind: float
    disk: float
    searched: float


@dataclass(frozen=True, eq=False)
class _Bundle:
    """Straight light behind a lens: cells by the rays of their four corners, or rays alone.

    start : (2, 4 or 1, n), x and y on the plane z0, mm.  slope : the same, tangents.  flux : (n,) W.
    middle : of cells, (start, slope), (2, n) each.
    z0, depth : mm behind the rear vertex, of that plane and, on average, of the points where rays leave.
    front : W/mm^2, of what is lit of the first face; of a beam, across it.
    disk : mm, the least in which rays tell the irradiance.
    """

    start: Floats
    slope: Floats
    middle: tuple[Floats, Floats]
    flux: Floats
    z0: float
    depth: float
    front: float
    disk: float

    def of(self, some: Integers) -> _Bundle:
        """Return some of the cells or rays.  some : their numbers."""
        return replace(
            self,
            start=self.start[:, :, some],
            slope=self.slope[:, :, some],
            middle=(self.middle[0][:, some], self.middle[1][:, some]),
            flux=self.flux[some],
        )


def greatest_concentration(system: OpticalSystem, lens: Lens, backend: Backend) -> Concentration:
    """Return the Concentration of the light of a lens through front and rear.

    Rough faces are taken as smooth.  backend : of double precision.

    Raises UserError : no light leaves the lens.
    """
    brightest = system.source.spread.brightest if system.source.diverging else inf
    sine = sqrt(1 / (pi * brightest))
    bundle, seen = _leaving(system.shaping, lens, backend)
    throw = system.path(lens).throw_of(-1)
    farthest = max(bundle.z0, FAR if isinf(throw) else throw)
    planes = bundle.z0 + (farthest - bundle.z0) * (np.arange(PLANES + 1) / PLANES) ** 2

    def on_plane(light: _Bundle, s: float, blocks: int = SEARCHED) -> tuple[float, float, float]:
        """Return (greatest mean irradiance on a disk, its diameter, s)."""
        disk = max(SMALLEST_DISK, bundle.disk, 2 * (s - bundle.depth) * sine / sqrt(1 - sine * sine))
        return 4 * _most_in_disk(light, s - light.z0, disk, blocks) / (pi * disk**2), disk, float(s)

    found = [on_plane(seen, s) for s in planes]
    for k in np.argsort([-light for light, _, _ in found])[:2]:
        ends = planes[max(k - 1, 0)], planes[min(k + 1, PLANES)]
        steps = {"maxiter": CLOSER}
        closest = minimize_scalar(
            lambda s: -on_plane(seen, s)[0], bounds=ends, method="bounded", options=steps
        )
        found.append(on_plane(seen, closest.x))
    light, disk, behind = on_plane(bundle, max(found)[2], SEARCHED_LAST)
    times = light / bundle.front
    far = system.source.beam
    return Concentration(times, light, SUNLIGHT * times if far else None, behind, disk, float(farthest))


def _leaving(system: OpticalSystem, lens: Lens, backend: Backend) -> tuple[_Bundle, _Bundle]:
    """Return the light behind a lens without losses, and the same in cells that are COARSER times as large.

    Raises UserError : there is none.
    """
    cells = None if system.source.extended else system.source.cells((CELLS, CELLS))
    rays = system.source.rays((CELLS, CELLS)) if cells is None else cells.rays()
    path = system.path(lens).without_absorption().without_reflection()
    tracer = Tracer(backend, path.onto(Plane(path.leaving)), rays)
    ahead = path.leaving.inverse() @ path.surfaces[-1].pose
    with backend.dr.suspend_grad():
        hits, landing = tracer.trace_all()
        first, last = (h[0] for h in ([h for h in way if h is not None] for way in (hits, hits[::-1])))
        every = backend.dr.ones(backend.dr.mask_t(backend.Float), rays.flux.size)
        onto, out = every & first.hit, every & landing.arrives
        across = first.x, first.y
        if system.source.beam:  # a face that is turned has less light on its area than the beam
            there = path.surfaces[0].pose.points((first.x, first.y, first.z))
            across = system.source.frame.inverse().points(there)[:2]
        height = ahead.points((last.x, last.y, last.z))[2]
        values = [*across, height, landing.x, landing.y, landing.p, landing.q, onto, out]
        backend.dr.eval(values)
    traced = [a.numpy() for a in values]
    if cells is None:
        whole = _bundle([a[None, :] for a in traced], np.ravel(rays.flux), RAYS_IN_DISK[1])
        return whole, whole
    whole, coarse = (
        _bundle([_corners(a, cells, step) for a in traced], _merged(cells.emitted, step), RAYS_IN_DISK[0])
        for step in (1, COARSER)
    )
    return whole, replace(coarse, disk=whole.disk)


def _bundle(traced: Sequence[Floats], emitted: Floats, in_disk: int) -> _Bundle:
    """Return cells (4, n) or rays (1, n) as a _Bundle.

    traced : what `_leaving` knows of them.  in_disk : that tell the irradiance.

    Raises UserError : there are none.
    """
    u, v, height, x, y, p, q, onto, out = traced
    lit, leaves = onto.all(axis=0) & (emitted > 0), out.all(axis=0) & (emitted > 0)
    if not leaves.any() or np.count_nonzero(lit) < LEAST_RAYS:
        raise UserError("no light leaves the lens by front and rear; check the source and the lens")
    area = ConvexHull(np.stack([u[:, lit], v[:, lit]], axis=-1).reshape(-1, 2), qhull_options="QJ").volume
    height, flux, z0 = height[:, leaves], emitted[leaves], float(height[:, leaves].max())
    slope = np.stack([p, q])[:, :, leaves]
    slope /= np.sqrt(1 - (slope**2).sum(axis=0))
    start = np.stack([x, y])[:, :, leaves] + z0 * slope
    return _Bundle(
        start=start,
        slope=slope,
        middle=(start.mean(axis=1), slope.mean(axis=1)),
        flux=flux,
        z0=z0,
        depth=float(np.average(height.mean(axis=0), weights=flux)),
        front=float(emitted[lit].sum()) / area,
        disk=2 * sqrt(in_disk * area / np.count_nonzero(lit) / pi),
    )


def _corners(traced: Floats, cells: SourceCells, step: int) -> Floats:
    """Return what is known of rays for the four corners of every cell, (4, n).  step : of merged cells."""
    at = traced.reshape(len(cells.s), len(cells.t))[::step, ::step]
    return np.stack([at[i : i - 1 or None, j : j - 1 or None].ravel() for i in (0, 1) for j in (0, 1)])


def _merged(emitted: Floats, step: int) -> Floats:
    """Return the flux of cells of which step^2 are merged, (n,)."""
    nx, ny = (n // step for n in emitted.shape)
    return emitted.reshape(nx, step, ny, step).sum(axis=(1, 3)).ravel()


def _most_in_disk(bundle: _Bundle, way: float, diameter: float, blocks: int, best: float = 0.0) -> float:
    """Return the greatest flux within a disk on a plane, W; no less than the best known.

    way : mm behind the plane z0.  blocks : to look in

    A disk lies in 2 x 2 blocks of its size.  It is looked for in the brightest of these.  Where light is so
    wide that blocks are larger than a disk, each is cut into blocks again.
    """
    a, b = bundle.middle[0] + way * bundle.middle[1]
    a -= a.min()
    b -= b.min()
    block = max(diameter, max(a.max(), b.max()) / BLOCKS)
    i, j = ((c / block).astype(int) for c in (a, b))
    rows, columns = i.max() + 2, j.max() + 2  # a dark one behind the last
    number = i * columns + j
    light = np.bincount(number, bundle.flux, rows * columns).reshape(rows, columns)
    pairs = light[1:] + light[:-1]
    four = (pairs[:, 1:] + pairs[:, :-1]).ravel()
    brightest = np.argpartition(-four, min(blocks, four.size) - 1)[:blocks]
    for k in brightest[np.argsort(-four[brightest])]:
        if four[k] <= best:
            break
        row, column = divmod(int(k), columns - 1)
        wanted = np.zeros((rows, columns), bool)
        wanted[row : row + 2, column : column + 2] = True
        inside = np.flatnonzero(wanted.ravel()[number])
        if block > WIDER * diameter and len(inside) < len(a):
            best = _most_in_disk(bundle.of(inside), way, diameter, blocks, best)
            continue
        x, y = bundle.start[:, :, inside] + way * bundle.slope[:, :, inside]
        best = max(best, _most_of_few(x, y, bundle.flux[inside], diameter))
    return best


def _most_of_few(x: Floats, y: Floats, flux: Floats, diameter: float) -> float:
    """Return the same of light that is near: on bins, summed over disks around bins.

    Where they are few, cells are cut into equal parts.  Each is shared by the four bins around its middle.
    """
    if len(x) > 1:
        parts = max(1, min(PARTS, isqrt(MOST_PARTS // len(flux))))
        at = (np.arange(parts) + 0.5) / parts
        s, t = (a.ravel() for a in np.meshgrid(at, at))
        weights = np.stack([(1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t], axis=1)
        x, y, flux = weights @ x, weights @ y, np.tile(flux / parts**2, (parts**2, 1))
    a, b = ((c - c.min()) * ACROSS / diameter for c in (x.ravel(), y.ravel()))
    u, v = a % 1, b % 1
    i, j = _gathered(a.astype(int)), _gathered(b.astype(int))
    shape = i.max() + 2, j.max() + 2
    light = np.zeros(shape[0] * shape[1])
    for di, along in ((0, 1 - u), (1, u)):
        for dj, across in ((0, 1 - v), (1, v)):
            light += np.bincount((i + di) * shape[1] + j + dj, along * across * flux.ravel(), light.size)
    return float(convolve(light.reshape(shape), _disk(), mode="constant").max())


def _gathered(bins: Integers) -> Integers:
    """Return the numbers of bins where dark gaps wider than a disk are cut to that.

    Parts of few cells may lie far apart; what no disk joins stays apart.
    """
    lit = np.flatnonzero(np.bincount(bins))
    moved = np.zeros(lit[-1] + 1, int)
    moved[lit] = np.cumsum(np.minimum(np.diff(lit, prepend=lit[0]), len(_disk()) + 1))
    return moved[bins]


@cache
def _disk() -> Floats:
    """Return the shares of bins that lie in a disk of ACROSS bins around the middle one, (odd, odd)."""
    side, fine = 2 * (ACROSS // 2) + 1, 16
    at = (np.arange(side * fine) + 0.5) / fine - side / 2
    inside = np.hypot(at, at[:, None]) <= ACROSS / 2
    return inside.reshape(side, fine, side, fine).mean(axis=(1, 3))
