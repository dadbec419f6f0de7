"""Where the light between a lens and its target is concentrated most.

Without losses every ray keeps its flux.  Behind a face it is straight up to the next one, if there is any, so
that it meets the plane at z in x(z) = x + (z - z0) tan u.  The irradiance of sharp light is infinite on
caustics.  What counts is its mean over a disk of the diameter

    d = max(1 mm, 2 s tan a, what RAYS_IN_DISK take),    pi sin^2 a = 1 / b,

with the way s from the rear and the radiance b on the axis of a diverging beam, by flux and area: a disk
that is as bright everywhere has the half-angle a.  Light of a point of the rear is such a disk on the plane,
so that the mean of sharp light over it is the irradiance of the blurred light.  Beams before several elements
do not diverge.  On every plane counts what is on its way there, or meets a face within half a disk of it: so
planes that cut a face tell what falls on it.

The concentration is that mean over the irradiance of the front, its own mean over what is lit of it.
Sunlight of 1 kW/m^2 is concentrated to as many kW/m^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import inf, isqrt, pi, sqrt

import numpy as np
from scipy.ndimage import convolve
from scipy.optimize import minimize_scalar

from optics.base.runtime import Backend
from optics.light.outgoing.straight_light import StraightLight, straight_light
from optics.scene.system import System
from thbcad.checks import Floats, Integers

SMALLEST_DISK = 1.0  # mm: heat spreads from smaller ones before paper or wood burns
CELLS = 512  # of sharp light in each direction; their square is the number of rays of other light
PARTS, MOST_PARTS = 4, 1 << 16  # of a cell in each direction; of all cells, where they are not more
PLANES, CLOSER = 48, 12  # looked at, close together near the rear; steps around the two best of them
AT_FACE = 8  # planes more, across a face to which light comes through air or which reflects
ACROSS = 6  # bins across a disk
FARTHEST = 2**28  # disks from the middle of the light: what is wider is thin there
BRIGHT = 16384  # blocks around which disks are looked for
ROW = 4 * FARTHEST  # from the number of a block to that of the next one in x
STEPS = 0, 1, ROW, ROW + 1  # from the first of 2 x 2 blocks to all of them
SEARCHED, SEARCHED_LAST = 4, 64  # of these, the brightest, for disks; on the plane that is found
SUNLIGHT = 1.0  # kW/m^2, across the beam


@dataclass(frozen=True)
class Concentration:
    """The greatest concentration of light on a plane between lens and target, across the way of the light.

    Of several elements it is that of all ways through air, from the first of them on.

    times : the mean irradiance on a disk, over that of the beam, or of the first face.
    irradiance : on that disk, of the source's own flux, W/mm^2 (lm/mm^2), without losses
    sunlight : kW/m^2 on it where the sun shines along a beam's axis; None of sources that are no beams
    face : behind which the plane is, by its number among the faces that light meets, from 0.
    behind : mm from the vertex of that face to the plane.  disk : mm, its diameter.
    searched : mm behind the vertex of the last face, up to where light was followed.
    """

    times: float
    irradiance: float
    sunlight: float | None
    face: int
    behind: float
    disk: float
    searched: float


def greatest_concentration(system: System, backend: Backend) -> Concentration:
    """Return the greatest Concentration of light on all its ways through air from the first element on.

    Rough faces are taken as smooth.  Light in glass is left out, and light beside an element, behind it.

    backend : of double precision.

    Raises UserError : no light leaves the lens.
    """
    radiance = system.source.spread.on_axis if system.source.diverging else inf
    sine = sqrt(1 / (pi * radiance))
    front, ways = straight_light(system.shaping, backend, CELLS)

    def on_plane(light: StraightLight, s: float, blocks: int = SEARCHED) -> tuple[float, float, float]:
        """Return (greatest mean irradiance on a disk, its diameter, s)."""
        disk = max(SMALLEST_DISK, light.disk, 2 * (s - light.depth) * sine / sqrt(1 - sine * sine))
        there = light.around(s, disk / 2)
        most = _most_in_disk(there, s - light.z0, disk, blocks) if there.flux.size else 0.0
        return 4 * most / (pi * disk**2), disk, float(s)

    def densest(light: StraightLight, planes: Floats) -> tuple[float, float, float]:
        """Return the greatest of `on_plane`: of planes, and close to the two best of them."""
        found = [on_plane(light, s) for s in planes]
        for k in np.argsort([-mean for mean, _, _ in found])[:2]:
            ends = planes[max(k - 1, 0)], planes[min(k + 1, len(planes) - 1)]
            steps = {"maxiter": CLOSER}
            closest = minimize_scalar(
                lambda s: -on_plane(light, s)[0], bounds=ends, method="bounded", options=steps
            )
            found.append(on_plane(light, closest.x))
        return max(found)

    found = [densest(seen, _planes(whole)) for whole, seen in ways]
    way = found.index(max(found))
    whole, _ = ways[way]
    light, disk, behind = on_plane(whole, found[way][2], SEARCHED_LAST)
    times = light / front
    sun = SUNLIGHT * times if system.source.beam else None
    return Concentration(times, light, sun, whole.face, behind, disk, ways[-1][0].farthest)


def _planes(light: StraightLight) -> Floats:
    """Return the heights of planes to look at, mm: close together where light leaves the face."""
    at_face = np.linspace(light.nearest, light.z0, AT_FACE, endpoint=False)
    behind = light.z0 + (light.farthest - light.z0) * (np.arange(PLANES + 1) / PLANES) ** 2
    return behind if light.nearest == light.z0 else np.concatenate([at_face, behind])


def _most_in_disk(light: StraightLight, way: float, diameter: float, blocks: int) -> float:
    """Return the greatest flux within a disk on a plane, W.

    way : mm behind the plane z0.  blocks : to look in

    A disk lies in 2 x 2 blocks of its size.  It is looked for in the brightest of these that hold one of the
    BRIGHT brightest blocks.  Only blocks that light meets are kept: what is wide costs no more.
    """
    a, b = ((c - np.median(c)) / diameter for c in light.middle[0] + way * light.middle[1])
    near = np.flatnonzero((np.abs(a) < FARTHEST) & (np.abs(b) < FARTHEST))
    if not near.size:
        return 0.0
    number = np.floor(a[near]).astype(np.int64) * ROW + np.floor(b[near]).astype(np.int64)
    order = np.argsort(number, kind="stable")
    number = number[order]
    first = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
    lit, ends, flux = (
        number[first],
        np.append(first, len(order)),
        np.add.reduceat(light.flux[near[order]], first),
    )
    bright = np.argpartition(-flux, min(BRIGHT, flux.size) - 1)[:BRIGHT]
    corners = np.unique(np.concatenate([lit[bright] - step for step in STEPS]))
    places = [np.minimum(np.searchsorted(lit, corners + step), len(lit) - 1) for step in STEPS]
    there = [lit[place] == corners + step for place, step in zip(places, STEPS)]
    four = np.sum([np.where(met, flux[place], 0.0) for place, met in zip(places, there)], axis=0)
    brightest = np.argpartition(-four, min(blocks, four.size) - 1)[:blocks]
    best = 0.0
    for k in brightest[np.argsort(-four[brightest])]:
        if four[k] <= best:
            break
        some = [order[ends[p[k]] : ends[p[k] + 1]] for p, met in zip(places, there) if met[k]]
        inside = near[np.sort(np.concatenate(some))]
        x, y = light.start[:, :, inside] + way * light.slope[:, :, inside]
        best = max(best, _most_of_few(x, y, light.flux[inside], diameter))
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
