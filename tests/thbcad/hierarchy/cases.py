"""Spaces on the unit square with blocks of refined cells, and the roundings of their operators."""

import numpy as np

from thbcad.hierarchy.thb_space import THBSpace
from thbcad.splines import KnotVector

ORDERS = [(0, 0), (1, 0), (0, 1)]


def uniform_space(degree=3, spans=8, stop=1.0):
    kv = KnotVector.uniform(degree, spans, 0.0, stop)
    return THBSpace(kv, kv)


def block(i0, i1, j0, j1):
    return [(i, j) for i in range(i0, i1) for j in range(j0, j1)]


def refined_by(space, marked):
    for level, cells in enumerate(marked):
        space = space.refine({level: cells})
    return space


def dof_per_level(space):
    return np.bincount(space.functions[:, 0], minlength=space.levels).tolist()


def entry_roundings(space):
    """Roundings in an entry of a prolongation or embedding: 5 per degree and direction, and the sums, for
    every level."""
    p, q = space.kv_u.degree, space.kv_v.degree
    return (5 * (p + q) + (p + 2) * (q + 2)) * space.levels
