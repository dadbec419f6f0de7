"""A smooth function, spaces of one and of two levels, and scattered points."""

import numpy as np

from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector


def smooth(u, v):
    return np.sin(3 * u + 0.3) * np.cos(2 * v)


def tensor(degree, spans):
    kv = KnotVector.uniform(degree, spans)
    return THBSpace(kv, kv)


def refined(degree, spans=6, block=4):
    """A tensor-product space with a block of cells refined."""
    return tensor(degree, spans).refine({0: np.argwhere(np.ones((block, block)))})


def everywhere(rng, n=4000):
    return rng.random((2, n))
