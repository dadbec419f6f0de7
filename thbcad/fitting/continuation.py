"""Splines beside the outline of a surface: the smoothest continuation of what lies inside.

Of a THB space over a rectangle, the functions with less than a share of their support inside an outline are
not free.  Their coefficients d follow the free ones f, so that the thin-plate energy of the whole spline

    (f, d)^T E (f, d) = integral of s_uu^2 + 2 s_uv^2 + s_vv^2,    E_dd d = -E_df f,

is least: no coefficient outside jumps.  The map is linear, and the spline of a plane is continued as that
plane.
"""

from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import SuperLU

from thbcad.checks import Floats
from thbcad.fitting.normal_equations import symmetric_lu, thin_plate
from thbcad.hierarchy import THBSpace
from thbcad.outlines import Outline

LEAST_SHARE = 0.25  # of its support: with less inside, a function is hardly seen


def cell_shares(space: THBSpace, outline: Outline, beside: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Return the share of every leaf cell that lies in an outline, (n_cells,).

    outline : it is stretched over the rectangle of the space.
    beside : by how many of its sides a cell is widened on either side, in u and in v.
    """
    ends = np.array([(kv.start, kv.stop) for kv in (space.kv_u, space.kv_v)])
    boxes = space.boxes.reshape(-1, 2, 2) - ends.mean(axis=1)[:, None]
    low, high = np.moveaxis(boxes, 2, 0)
    more = np.array(beside) * (high - low)
    around = outline.scaled(np.diff(ends, axis=1)[:, 0] / 2)
    (u0, v0), (u1, v1) = (low - more).T, (high + more).T
    return around.shares((u0, v0), (u1, v1))


class Continuation:
    """The projection c -> (f, d) of the coefficients of a space, and its adjoint.

    outline : it is stretched over the rectangle of the space.
    free : (dim,) bool, the functions whose coefficients stay.

    >>> kv = KnotVector.uniform(degree=3, spans=8, start=-1.0, stop=1.0)
    >>> beside = Continuation(THBSpace(kv, kv), Outline((1.0, 1.0), (1.0, 1.0)))
    >>> beside.free.size, int(beside.free.sum())
    (121, 97)
    """

    def __init__(self, space: THBSpace, outline: Outline) -> None:
        self._space, self.free = space, np.ones(space.dim, dtype=bool)
        if outline.is_rectangle:
            return
        u0, u1, v0, v1 = space.boxes.T
        inside = cell_shares(space, outline)
        areas, acting = (u1 - u0) * (v1 - v0), csr_array(space.incidence().T, dtype=np.float64)
        self.free = acting @ (areas * inside) >= LEAST_SHARE * (acting @ areas)
        self._followed = acting

    def __call__(self, coefficients: Floats) -> Floats:
        """Return the coefficients, (dim,), those that are not free replaced."""
        if self.free.all():
            return coefficients
        factors, across = self._equations
        out = coefficients.copy()
        out[~self.free] = -factors.solve(across @ coefficients[self.free])
        return out

    def adjoint(self, gradient: Floats) -> Floats:
        """Return the derivative by the coefficients that come in, from that by those that go out, (dim,)."""
        if self.free.all():
            return gradient
        factors, across = self._equations
        out = np.zeros_like(gradient)
        out[self.free] = gradient[self.free] - across.T @ factors.solve(gradient[~self.free])
        return out

    @cached_property
    def _equations(self) -> tuple[SuperLU, csr_array]:
        """E_dd, factorised, and E_df."""
        follows = ~self.free
        where = self._followed[follows].sum(axis=0) > 0  # cells on which a function acts that is not free
        energy = thin_plate(self._space, where, follows)
        return symmetric_lu(energy[:, follows]), csr_array(energy[:, self.free])
