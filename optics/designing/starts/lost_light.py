"""The share of light that a surface reflects, or cannot send, on its way to the places of a transport map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import map_coordinates

from optics.designing.starts.rear_light import RearLight
from optics.designing.transport import LEAST_SHARE, height_from_slopes
from optics.light.refraction import ShapedSurface
from optics.light.tracing import transmittances
from optics.scene.paths import LightPath, Surface
from thbcad.checks import Floats

CELLS = 64  # in a direction, at most: they tell the share to a thousandth
STEPS = 4  # of slopes and height, which depend on each other


def stretched(places: Sequence[Floats], before: RearLight, now: RearLight) -> list[Floats]:
    """Return places for light on a turned surface: its rectangle takes those of its rectangle before."""
    at = []
    for axis, (row, new) in enumerate(((before.x, now.x), (before.y, now.y))):
        (a, b), (c, d) = (
            r[light.flux.sum(axis=1 - axis) > 0][[0, -1]] for r, light in ((row, before), (new, now))
        )
        at.append((a + (new - c) * (b - a) / (d - c) - row[0]) / (row[1] - row[0]))
    grid = np.meshgrid(*at, indexing="ij")
    return [map_coordinates(place, grid, order=1, mode="nearest") for place in places]


def passing_share(
    surface: Surface, shaped: ShapedSurface, along: Sequence[Floats], slopes: Sequence[Floats]
) -> Floats:
    """Return the share of light that a surface sends on, by Fresnel's equations where it is bare, (nx, ny).

    along : its unit directions.  slopes : of the surface.
    """
    (p, q, r), (sx, sy) = along, slopes
    if surface.share is not None:
        return np.ones_like(sx)
    cosine = (r - p * sx - q * sy) / np.sqrt(1 + sx**2 + sy**2)
    passing = np.mean(transmittances(*shaped.indices, np.arccos(np.clip(cosine, 0, 1)).ravel()), axis=0)
    return np.asarray(passing.reshape(cosine.shape))


def lost_share(
    path: LightPath, number: int, light: RearLight, places: Sequence[Floats], made_up: Floats
) -> float:
    """Return the share of the light that a surface loses, whose places on the receiver are known.

        1 - sum w p s / sum w,      w = Phi s0 / s

    Of every cell Phi is the flux, p whether a slope can send it to its place, s the share that then passes,
    and s0 that which the places make up for.  Light goes there by s0 / s: the same picture arrives.

    number : of the surface; its height follows.  places : u and v, (nx, ny), of the cells of the light.
    made_up : s0, (nx, ny).
    """
    shaped, surface = ShapedSurface.of(path, number), path.surfaces[number]
    some = tuple(slice(n // CELLS // 2, None, max(1, n // CELLS)) for n in light.counts)
    x, y = (row[part] for row, part in zip((light.x, light.y), some))
    along = [d[some] for d in light.direction]
    flux, wanted = light.flux[some], [a[some] for a in places]
    before = np.maximum(made_up[some], LEAST_SHARE)
    jet = [surface.shape.conic(x[:, None], y[None, :], d) for d in ((0, 0), (1, 0), (0, 1))]
    height, base = jet[0], jet[1:]
    for _ in range(STEPS):
        asked, possible = shaped.slopes((x[:, None], y[None, :], height), along, wanted)
        sx, sy = (np.where(possible & (flux > 0), s, b) for s, b in zip(asked, base))
        height = height_from_slopes(sx, sy, [x[1] - x[0], y[1] - y[0]]) + jet[0].mean()
    passing = passing_share(surface, shaped, along, (sx, sy))
    sent = flux * before / np.maximum(passing, LEAST_SHARE)
    return 1 - float(np.average(possible * passing, weights=sent))
