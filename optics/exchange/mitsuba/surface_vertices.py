"""Heights and slopes at the vertices of a mesh, and how they follow the coefficients of a sag.

The vertices lie on the grid of positions x times y.  With the tensor-product net C of the sag, which is
linear in its THB coefficients c, and with the matrices A, A' of the basis functions' values and slopes at x,
and B, B' at y,

    z = conic + A C B^T,    zx = conic_x + A' C B^T,    zy = conic_y + A C B'^T.

The derivative by the net is A^T gz B + A'^T gx B + A^T gy B'.  With the functions of other knots in place of
the sag's it is that by the heights of another net over the surface.  Over an outline with rounded corners the
vertices lie on no lines: every one has a row of its own in the matrices of values and slopes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from scipy.sparse import csr_array

from optics.base.runtime import Backend, DrArray
from thbcad.checks import Floats, read_only
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.splines import KnotVector

Jet: TypeAlias = "tuple[DrArray, DrArray, DrArray]"  # z, zx, zy, Float64 (n,) each

Matrices: TypeAlias = "list[tuple[csr_array, csr_array]]"  # values and slopes in x, and in y
ORDERS = ((0, 0), (1, 0), (0, 1))


@dataclass(frozen=True, eq=False)
class SurfaceVertices:
    """Vertices of one surface at the relative positions s x t in [-1, 1], t first; see `Outline.filled`.

    vertex : z of the surface's vertex in the lens's frame, mm.
    """

    surface: FreeformSurface
    vertex: float
    s: Floats
    t: Floats

    @cached_property
    def _lines(self) -> tuple[Floats, Floats]:
        """x and y of the grid lines, mm."""
        hx, hy = self.surface.half_width
        return hx * self.s, hy * self.t

    @cached_property
    def positions(self) -> tuple[Floats, Floats]:
        """x and y of all vertices, (n,) each, mm."""
        x, y = (a.ravel() for a in np.meshgrid(*self._lines, indexing="ij"))
        if not self._on_lines:
            x, y = self.surface.outline.filled(x, y)
        return read_only(x), read_only(y)

    @property
    def _on_lines(self) -> bool:
        return self.surface.outline.is_rectangle

    @cached_property
    def base(self) -> Floats:
        """z, zx, zy without the sag, (3, n)."""
        x, y = self.positions
        rows = [self.surface.conic(x, y, d) + np.zeros_like(x) for d in ORDERS]
        rows[0] += self.vertex
        return read_only(np.stack(rows))

    def jet(self, coefficients: Floats | None = None) -> Floats:
        """Return z, zx, zy, (3, n).  coefficients : (dim,), or None for the surface as it is."""
        if coefficients is not None:
            return self.base + self.push_forward(coefficients)
        if self._on_lines:
            rows = np.stack([self.surface.grid(*self._lines, d).ravel() for d in ORDERS])
        else:
            rows = np.stack([self.surface(*self.positions, d) for d in ORDERS])
        rows[0] += self.vertex
        return rows

    def push_forward(self, direction: Floats) -> Floats:
        """Return the change of `jet` with a change of the coefficients, (3, n)."""
        if not self._on_lines:
            return np.stack([rows @ direction for rows in self._rows(self.space)])
        (a0, a1), (b0, b1) = self._matrices
        net = self.space.embedding.coefficients(direction)
        values, slopes = (b @ net.T for b in (b0, b1))
        rows = [a0 @ values.T, a1 @ values.T, a0 @ slopes.T]
        return np.stack(rows).reshape(3, -1)

    def pull_back(self, gradients: Floats, knots: Sequence[KnotVector] | None = None) -> Floats:
        """Return the derivative by the coefficients, (dim,), from that by the jet, (3, n).

        knots : two knot vectors in mm; the derivative is then that by a net over these knots, (nx, ny).
        """
        if not self._on_lines:
            space = self.space if knots is None else THBSpace(*knots)
            out: Floats = sum(rows.T @ g for rows, g in zip(self._rows(space), gradients.reshape(3, -1)))
            return out if knots is None else out.reshape(knots[0].dim, knots[1].dim)
        (a0, a1), (b0, b1) = self._matrices if knots is None else self._on(knots)
        gz, gx, gy = gradients.reshape(3, len(self.s), len(self.t))
        along = a0.T @ gz + a1.T @ gx
        net = (b0.T @ along.T + b1.T @ (a0.T @ gy).T).T
        return net if knots is not None else self.space.embedding.adjoint(net)

    @property
    def space(self) -> THBSpace:
        """The space of the sag."""
        if self.surface.sag is None:
            raise ValueError("a surface without a sag has no coefficients")
        return self.surface.sag.space

    @cached_property
    def _matrices(self) -> Matrices:
        """The basis functions of the sag's net at the grid lines."""
        embedding = self.space.embedding
        knots = zip((embedding.kv_u, embedding.kv_v), self.surface.half_width)
        return self._on([kv.rescale(-h, h) for kv, h in knots])

    def _on(self, knots: Sequence[KnotVector]) -> Matrices:
        return [(kv.collocation(line), kv.collocation(line, 1)) for kv, line in zip(knots, self._lines)]

    def _rows(self, space: THBSpace) -> list[csr_array]:
        """Return what the functions of a space over the rectangle add to z, zx and zy of every vertex."""
        at, rates = [], []
        for kv, a, h in zip((space.kv_u, space.kv_v), self.positions, self.surface.half_width):
            low, high = kv.domain
            at.append(np.clip(low + (high - low) * (a / h + 1) / 2, low, high))
            rates.append((high - low) / (2 * h))
        return [space.collocation(at[0], at[1], (k, m)) * (rates[0] ** k * rates[1] ** m) for k, m in ORDERS]


def jet_operation(backend: Backend, surface: SurfaceVertices) -> type:
    """Return the Dr.Jit operation coefficients -> z, zx, zy, Float64 (n,) each."""

    base: Any = backend.dr.CustomOp

    class JetOperation(base):
        def eval(self, coefficients: DrArray) -> tuple[DrArray, ...]:
            return tuple(backend.array(row) for row in surface.jet(coefficients.numpy()))

        def forward(self) -> None:
            direction = np.broadcast_to(self.grad_in("coefficients").numpy(), surface.space.dim)
            self.set_grad_out(tuple(backend.array(row) for row in surface.push_forward(direction)))

        def backward(self) -> None:
            gradients = [np.broadcast_to(g.numpy(), len(surface.positions[0])) for g in self.grad_out()]
            self.set_grad_in("coefficients", backend.array(surface.pull_back(np.stack(gradients))))

        def name(self) -> str:
            return "heights and slopes of a THB surface"

    return JetOperation
