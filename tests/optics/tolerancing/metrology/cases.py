"""A small freeform surface, errors of its height, and points measured on it."""

import numpy as np
from numpy.typing import NDArray

from optics.tolerancing.machining import LandingResponse
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

Floats = NDArray[np.float64]
HALF_WIDTH = (10.0, 8.0)


def freeform() -> FreeformSurface:
    """Return a surface without any symmetry, refined in one corner."""
    knots = [KnotVector.uniform(3, 4, -h, h) for h in HALF_WIDTH]
    space = THBSpace(*knots).refine({0: [(0, 0), (1, 0), (0, 1), (1, 1)]})
    coefficients = 0.4 * np.sin(1.7 * np.arange(space.dim))
    return FreeformSurface(HALF_WIDTH, Conic(60.0, -0.5), THBSurface(space, coefficients))


def scattered(count: int, inside: float = 1.0, seed: int = 1) -> tuple[Floats, Floats]:
    """Return x and y of random points over a part of the surface, mm."""
    x, y = np.random.default_rng(seed).uniform(-inside, inside, (2, count))
    return HALF_WIDTH[0] * x, HALF_WIDTH[1] * y


def ripple(x: Floats, y: Floats) -> Floats:
    """Return an error of height of periods 5 and 8 mm, mm."""
    return 2e-4 * np.sin(2 * np.pi * x / 5) * np.cos(2 * np.pi * y / 8)


def everywhere(half_width=HALF_WIDTH, count=200) -> LandingResponse:
    """Return rays all over a surface."""
    x, y = (g.ravel() for g in np.meshgrid(*(h * np.linspace(-1, 1, count) for h in half_width)))
    ones = np.ones(x.size)
    return LandingResponse(ones > 0, x, y, ones, np.zeros((2, 2, x.size)))
