"""Tensor-product B-spline surfaces and THB surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thbcad.bspline import KnotVector, read_only
from thbcad.patches import patch_operators
from thbcad.space import THBSpace


@dataclass(frozen=True, eq=False)
class BSplineSurface:
    """S(u, v) = sum_ij N_i(u) N_j(v) c_ij with coefficients (n_u, n_v) or (n_u, n_v, d)."""

    kv_u: KnotVector
    kv_v: KnotVector
    coefficients: NDArray[np.float64]

    def __post_init__(self) -> None:
        c = read_only(self.coefficients)
        wanted = (self.kv_u.dim, self.kv_v.dim)
        if c.shape[:2] != wanted or c.ndim > 3:
            raise ValueError(f"coefficients must have shape {wanted} or {(*wanted, 'd')}, got {c.shape}")
        if not np.isfinite(c).all():
            raise ValueError("coefficients must be finite")
        object.__setattr__(self, "coefficients", c)

    def __call__(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> NDArray[np.float64]:
        """Return the values at scattered points (u_k, v_k), (n,) or (n, d)."""
        first_u, values_u = self.kv_u.basis(u, derivative[0])
        first_v, values_v = self.kv_v.basis(v, derivative[1])
        if len(first_u) != len(first_v):
            raise ValueError(f"u and v must have equal lengths, got {len(first_u)} and {len(first_v)}")
        c = self.coefficients
        out = np.zeros((len(first_u), *c.shape[2:]))
        for a, wu in enumerate(values_u.T):
            for b, wv in enumerate(values_v.T):
                weight = (wu * wv).reshape((-1,) + (1,) * (c.ndim - 2))
                out += weight * c[first_u + a, first_v + b]
        return out

    def grid(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> NDArray[np.float64]:
        """Return the values on the grid u x v, (len(u), len(v)) or (len(u), len(v), d)."""
        a, b = self.kv_u.collocation(u, derivative[0]), self.kv_v.collocation(v, derivative[1])
        c = self.coefficients
        by_u = a @ c.reshape(c.shape[0], -1)
        by_u = np.moveaxis(by_u.reshape((len(by_u), *c.shape[1:])), 1, 0)
        out = b @ by_u.reshape(c.shape[1], -1)
        return np.moveaxis(out.reshape((len(out), *by_u.shape[1:])), 0, 1)

    def integral(self) -> np.float64 | NDArray[np.float64]:
        """Return the integral over the domain, exact: sum_ij I_i I_j c_ij."""
        return np.einsum("i,j,ij...->...", self.kv_u.integrals(), self.kv_v.integrals(), self.coefficients)


@dataclass(frozen=True, eq=False)
class THBSurface:
    """The spline sum_f c_f T_f(u, v) over the truncated functions T_f of a THB space."""

    space: THBSpace
    coefficients: NDArray[np.float64]

    def __post_init__(self) -> None:
        c = read_only(self.coefficients)
        if c.shape[:1] != (self.space.dim,) or c.ndim > 2:
            raise ValueError(f"coefficients must have shape ({self.space.dim},) or ({self.space.dim}, d), got {c.shape}")
        if not np.isfinite(c).all():
            raise ValueError("coefficients must be finite")
        object.__setattr__(self, "coefficients", c)

    @cached_property
    def _tensor(self) -> BSplineSurface:
        embedding = self.space.embedding
        return BSplineSurface(embedding.kv_u, embedding.kv_v, embedding.coefficients(self.coefficients))

    def to_bspline(self) -> BSplineSurface:
        """Return the same surface as one tensor-product B-spline with only the knots needed."""
        return self._tensor

    def __call__(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> NDArray[np.float64]:
        """Return the values at scattered points (u_k, v_k), (n,) or (n, d)."""
        return self._tensor(u, v, derivative)

    def grid(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> NDArray[np.float64]:
        """Return the values on the grid u x v, (len(u), len(v)) or (len(u), len(v), d)."""
        return self._tensor.grid(u, v, derivative)

    def to_patches(self) -> list[BSplineSurface]:
        """Return the same surface as the fewest clamped B-spline patches over rectangles of same-level cells."""
        columns = self.coefficients.reshape(self.space.dim, -1).T
        nets = [np.stack(level, axis=-1) for level in zip(*(self.space.embedding.nets(c) for c in columns))]
        shape = self.coefficients.shape[1:]
        out = []
        for level, (kv_u, a_u), (kv_v, a_v) in patch_operators(self.space):
            net = np.stack([(a_v @ (a_u @ nets[level][..., k]).T).T for k in range(len(columns))], axis=-1)
            out.append(BSplineSurface(kv_u, kv_v, net.reshape((kv_u.dim, kv_v.dim, *shape))))
        return out

    def refine(self, cells: Mapping[int, ArrayLike]) -> THBSurface:
        """Return the same surface over ``space.refine(cells)``."""
        finer = self.space.refine(cells)
        return THBSurface(finer, self.space.prolongation(finer) @ self.coefficients)
