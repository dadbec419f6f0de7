"""Points of the unit cube by four samplings, and rays of a source through them."""

from __future__ import annotations

from collections.abc import Callable
from math import radians, sin

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from optics.scene.problem import Source
from optics.scene.sources import Rays, collimated_beam, concentric, single_rays
from thbcad import Lens

Floats = NDArray[np.float64]
UnitPoints = Callable[[np.random.Generator, int, int], Floats]


def random_points(rng: np.random.Generator, count: int, dimension: int) -> Floats:
    """Return `count` independent points of the unit cube, (count, dimension)."""
    return rng.random((count, dimension))


def jittered_points(rng: np.random.Generator, count: int, dimension: int) -> Floats:
    """Return one random point in each cell of a grid over the unit cube, (side^dimension, dimension)."""
    return _cells(count, dimension, rng.random)


def grid_points(rng: np.random.Generator, count: int, dimension: int) -> Floats:
    """Return the middles of the cells of a grid over the unit cube, (side^dimension, dimension)."""
    return _cells(count, dimension, lambda shape: np.full(shape, 0.5))


def sobol_points(rng: np.random.Generator, count: int, dimension: int) -> Floats:
    """Return scrambled Sobol points of the unit cube, (count, dimension)."""
    return qmc.Sobol(dimension, scramble=True, seed=rng).random(count)


def _cells(count: int, dimension: int, within: Callable[[tuple[int, int]], Floats]) -> Floats:
    side = round(count ** (1 / dimension))
    corners = np.stack(np.meshgrid(*[np.arange(side)] * dimension, indexing="ij"), axis=-1).reshape(
        -1, dimension
    )
    return (corners + within(corners.shape)) / side


def sampled_rays(source: Source, lens: Lens, points: UnitPoints, count: int, seed: int = 3) -> Rays:
    """Return about `count` rays of equal flux from a source before a lens, their position (and direction) by
    points of the unit cube."""
    rng = np.random.default_rng(seed)
    if source.kind == "collimated":
        s, t = 2 * points(rng, count, 2).T - 1
        one = collimated_beam(source.half_width, source.flux, lens.front.half_width, (1, 1))
        start = single_rays(one, lens)
        hx, hy = (min(a, b) for a, b in zip(source.half_width, lens.front.half_width))
        origin = np.stack([hx * s, hy * t, np.full_like(s, start.origin[2, 0])])
        direction = np.repeat(start.direction, len(s), axis=1)
        return Rays(origin, direction, np.full(len(s), one.total / len(s)))
    s, t, a, b = 2 * points(rng, count, 4).T - 1
    p, q = (r * sin(radians(source.half_angle)) for r in concentric(a, b))
    origin = np.stack([source.half_width[0] * s, source.half_width[1] * t, np.full_like(s, -source.distance)])
    direction = np.stack([p, q, np.sqrt(np.maximum(1 - p * p - q * q, 0.0))])
    return Rays(origin, direction, np.full(len(s), source.flux / len(s)))
