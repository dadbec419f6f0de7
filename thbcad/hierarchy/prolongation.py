"""Exact prolongation between nested THB spaces, and the change from the hierarchical basis.

The coefficient of an active function of the finer space is the coefficient that the spline has
there in the level's own B-spline basis (preservation of coefficients).

Source: C. Giannelli, B. Juettler, H. Speleers, Strongly stable bases for adaptively refined
multilevel spline spaces, Adv. Comput. Math. 40 (2014).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from thbcad.hierarchy.level_nets import Nets


def prolongation(coarser: Nets, finer: Nets) -> csr_array:
    """Return P from the coarser to the finer space."""
    rows = [
        fine.find(coarse.functions[coarse.active]) for coarse, fine in zip(coarser.hierarchy, finer.hierarchy)
    ]
    rows += [np.zeros(0, dtype=np.int64)] * (len(finer.sizes) - len(rows))
    return finer.onto_active(finer.operators(rows))


def hierarchical(nets: Nets) -> csr_array:
    """Return the change from coefficients by the hierarchical (not truncated) B-splines to those by the
    truncated ones."""
    return nets.onto_active(nets.operators(nets.active, truncated=False))
