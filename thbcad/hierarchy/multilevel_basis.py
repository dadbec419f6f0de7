"""A multilevel generating system of a THB space, for well-conditioned optimisation.

The spline is written as a sum over all levels of all B-splines of that level supported in
Omega_l (active or not), those of level l scaled by 2^-l:

    s = sum_l 2^-l sum_i w_(l,i) N_(l,i).

The system is redundant but spans the THB space.  For functionals of the second derivatives,
such as irradiance, its normal equations are well conditioned at any depth, where those of the
THB basis grow by a factor of 4 to 16 with each level.

Source: J. Bramble, J. Pasciak, J. Xu, Parallel multilevel preconditioners, Math. Comp. 55 (1990).
"""

from collections.abc import Iterable

import numpy as np

from thbcad.checks import Floats
from thbcad.hierarchy.thb_space import THBSpace


class MultilevelBasis:
    """The linear map M from multilevel weights w, (size,), to THB coefficients, (dim,)."""

    def __init__(self, space: THBSpace) -> None:
        self._embedding = space.embedding
        self._counts = [len(rows) for rows in self._embedding.supported]
        self._scales = [0.5**level for level in range(len(self._counts))]
        self.size = sum(self._counts)

    def coefficients(self, weights: Floats) -> Floats:
        """Return M w."""
        e = self._embedding
        parts = np.split(weights, np.cumsum(self._counts)[:-1])
        out = []
        net = np.zeros(e.shape(0))
        for level, (part, scale) in enumerate(zip(parts, self._scales)):
            net = e.refined(level, net) if level else net
            net.ravel()[e.supported[level]] += scale * part
            out.append(net.ravel()[e.active[level]])
        return np.concatenate(out)

    def adjoint(self, gradient: Floats) -> Floats:
        """Return M^T g."""
        e = self._embedding
        parts = np.split(gradient, np.cumsum([len(rows) for rows in e.active])[:-1])
        out = []
        top = len(self._counts) - 1
        net = np.zeros(e.shape(top))
        for level in range(top, -1, -1):
            net = e.refined_adjoint(level + 1, net) if level < top else net
            net.ravel()[e.active[level]] += parts[level]
            out.append(self._scales[level] * net.ravel()[e.supported[level]])
        return np.concatenate(out[::-1])

    def diagonal(self, nets: Iterable[Floats]) -> Floats:
        """Return the diagonal of a quadratic form of the spline by w.

        nets : that by all B-splines of each W_l, as a net of W_l.
        """
        return np.concatenate(
            [
                scale**2 * net.ravel()[rows]
                for net, scale, rows in zip(nets, self._scales, self._embedding.supported)
            ]
        )
