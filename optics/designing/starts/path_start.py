"""What a picture asks of one free surface of any light path: slopes that send light where it is wanted.

In the frame of the surface, for every cell of the light that meets it: optimal transport tells the place
(u, v) on the receiver, what lies behind the surface the direction to it, the law of refraction or reflection
the normal, and a fit the height; then all again.  Off axis no surface has the slopes that are asked for.
What would land beside is asked for elsewhere (`prewarped`), until that changes little.  Half of the cells in
each direction do in all rounds but the last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from optics.base.runtime import Backend
from optics.designing.starts.lost_light import passing_share
from optics.designing.starts.path_light import light_on, picture_on, resampled
from optics.designing.starts.rear_light import LEAST_WEIGHT, RearLight
from optics.designing.starts.transport_chart import Middle, TransportChart
from optics.designing.transport import Transport, prewarped, transport_map
from optics.light.refraction import ShapedSurface
from optics.scene.paths import LightPath
from optics.scene.sources import LightSource
from thbcad.checks import Floats
from thbcad.fitting import fit_slopes
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.surfaces import THBSurface

JET = (0, 0), (1, 0), (0, 1)
COARSE_FITS = 3  # in a round, since the slopes that are wanted depend on the height; then a fine one
COARSE, FINE = 2, 4  # levels of these fits, at most
CELLS_PER_FUNCTION = 1.5  # in a direction, at least
MOST_ROUNDS = 5
# in each direction, of the rounds before the last (disk to Gaussian by a mirror, 128 cells: the design's
# rel_l2 is 0.019, after rounds on 64 cells 0.047)
LEAST_CELLS = 128
CHANGE = 0.05  # of the light to ask for, relative to that wanted: with less another round does not pay
# pixels that light lands beside its place, root mean square, from which on this is as uneven as the picture
# (pearl on a screen turned by 71 degrees: the start's rel_l2 is 0.136 with fine bins and 0.195 without)
FAR = 1.0
MOVED = 1e-3  # of the surface's width: light that its new height moves by less is not traced again


@dataclass(frozen=True, eq=False)
class Picture:
    """Light on the chart of a receiver.

    flux : (nx, ny), of its pixels, of any scale.  centre, half : of its rectangle in u and v.
    crosses : the light crosses on its way to it.
    """

    flux: Floats
    centre: tuple[float, float]
    half: tuple[float, float]
    crosses: bool = False

    def corners(self) -> list[Floats]:
        """Return u and v of the corners of the pixels, (nx + 1, ny + 1) each."""
        sides = zip(self.centre, self.half, self.flux.shape)
        rows = (c + h * (2 * np.arange(n + 1) / n - 1) for c, h, n in sides)
        return list(np.meshgrid(*rows, indexing="ij"))

    def relative(self, y: Sequence[Floats]) -> list[Floats]:
        """Return u and v with the rectangle as [-1, 1]^2."""
        return [(a - c) / h for a, c, h in zip(y, self.centre, self.half)]


@dataclass(frozen=True, eq=False)
class ShapedLight:
    """What a picture asks of a surface.

    light : that meets it.  above : the slopes that its sag needs, (nx, ny) each, which go on without light.
    bent : share of the light that slopes can send to where the map wants it.  places : u and v there.
    made_up : (nx, ny), the share of a cell's light that passes, as far as places make up for it.
    transport : the map behind these places.
    """

    light: RearLight
    above: list[Floats]
    bent: float
    places: Sequence[Floats]
    made_up: Floats
    transport: Transport


def shaped_along(
    backend: Backend,
    path: LightPath,
    number: int,
    source: LightSource,
    wanted: Picture,
    counts: tuple[int, int],
    finest: int,
    rounds: int = MOST_ROUNDS,
) -> ShapedLight:
    """Return what a picture asks of a surface of a path that carries a sag.

    number : of the surface.  source : taken without extent.  counts : (nx, ny) cells of the surface's
    rectangle.  finest : level of the meshes of the fits, at most.  rounds : of transport and fits, at most.
    """
    shape, shaped = path.surfaces[number].shape, ShapedSurface.of(path, number)
    assert shape.sag is not None
    space = shape.sag.space
    sag, asked, chart = THBSurface(space, np.zeros(space.dim)), wanted, None
    settled, needed = False, None
    for left in reversed(range(rounds)):
        grid = counts if settled or not left else _halved(counts)
        coarse, fine = _meshes(space, grid, finest)
        light = light_on(backend, path.with_shape(number, shape.with_sag(sag)), number, source, grid)
        flux, first = light.flux, sag.grid(light.x, light.y)
        if chart is None:
            height = shape.conic(light.x[:, None], light.y[None, :]) + first
            chart = Middle.of(shaped, light, height, wanted.centre, wanted.half).chart(wanted.crosses)
            corners = chart.to(wanted.corners())
        transport, sent = _sent(backend, light, chart, corners, asked)
        for mesh in [coarse] * COARSE_FITS + [fine]:
            points, slopes = _jet(shape.with_sag(sag), light)
            near = slopes if needed is None or needed[0].shape != grid else needed
            needed, possible = shaped.slopes(points, light.direction, sent, near)
            known = possible & (light.weight > LEAST_WEIGHT)
            conic = _jet(FreeformSurface(shape.half_width, shape.conic), light)[1]
            # elsewhere slopes go on as coarse fits let them; a fine one then takes all alike, which is quick
            zx, zy = above = [np.where(known, n, s) - c for n, s, c in zip(needed, slopes, conic)]
            weight = np.ones(grid) if mesh is fine else np.where(known, 1.0, LEAST_WEIGHT)
            sag = fit_slopes(mesh, light.x, light.y, zx, zy, weight)
        points, slopes = _jet(shape.with_sag(sag), light)
        landed = shaped.landing(points, light.direction, slopes)
        beside = [np.nan_to_num((a - b) / h) for a, b, h in zip(landed, sent, wanted.half)]
        off = sum((d * n / 2) ** 2 for d, n in zip(beside, wanted.flux.shape))
        far = bool(np.average(off, weights=flux) > FAR**2)
        before = asked
        share = passing_share(path.surfaces[number], shaped, light.direction, slopes)
        at = wanted.relative(sent)
        asked = replace(wanted, flux=prewarped(wanted.flux, at, beside, flux, far, share))
        p, q, r = light.direction
        aside = (sag.grid(light.x, light.y) - first) * np.hypot(p, q) / r
        moved = np.sqrt(np.average(aside**2, weights=flux)) / (2 * max(shape.half_width))
        unchanged = moved < MOVED and _difference(asked, before) < CHANGE * _difference(wanted)
        if unchanged and grid == counts:
            break
        settled = settled or unchanged
    return ShapedLight(light, above, float(np.average(possible, weights=flux)), sent, share, transport)


def _halved(counts: tuple[int, int]) -> tuple[int, int]:
    """Return half as many cells in each direction, but no fewer than LEAST_CELLS where there are more."""
    nx, ny = (min(n, max(LEAST_CELLS, n // 2)) for n in counts)
    return nx, ny


def _meshes(space: THBSpace, counts: tuple[int, int], finest: int) -> tuple[THBSpace, THBSpace]:
    """Return a coarse and a fine mesh that samples on cells determine."""
    spans = [kv.dim - kv.degree for kv in (space.kv_u, space.kv_v)]
    seen = int(np.log2(min(n / (CELLS_PER_FUNCTION * s) for n, s in zip(counts, spans))))
    coarse, fine = (space.uniform(max(0, min(level, seen, finest))) for level in (COARSE, FINE))
    return coarse, fine


def _jet(shape: FreeformSurface, light: RearLight) -> tuple[tuple[Floats, ...], list[Floats]]:
    """Return the points of a surface on the grid of light, and its slopes."""
    height, *slopes = (shape.grid(light.x, light.y, d) for d in JET)
    return (light.x[:, None], light.y[None, :], height), slopes


def _difference(one: Picture, other: Picture | None = None) -> float:
    """Return the norm of the difference of two pictures of mean 1; with one, that of this picture."""
    less = 0.0 if other is None else other.flux / other.flux.mean()
    return float(np.linalg.norm(one.flux / one.flux.mean() - less))


def _sent(
    backend: Backend, light: RearLight, chart: TransportChart, q: Sequence[Floats], asked: Picture
) -> tuple[Transport, list[Floats]]:
    """Return optimal transport, and u and v of where it sends the light's cells, (nx, ny) each.

    q : of the corners of the picture's pixels on the chart.
    """
    box = [(float(a.min()), float(a.max())) for a in q]
    density = resampled(picture_on(backend, q, asked.flux, box, light.counts))
    halves = [(high - low) / 2 for low, high in box]
    widths = [n * (row[1] - row[0]) for n, row in zip(light.counts, (light.x, light.y))]
    aspect = float(np.sqrt(widths[0] * halves[0] / (widths[1] * halves[1])))
    transport = transport_map(backend, density, light.counts, aspect, light.emitted)
    places = chart.back([low + (t + 1) * h for (low, _), t, h in zip(box, transport.places, halves)])
    return transport, [np.clip(a, c - h, c + h) for a, c, h in zip(places, asked.centre, asked.half)]
