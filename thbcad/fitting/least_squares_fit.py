"""Least squares in a THB space, with thin-plate smoothing.

The normal equations N c = A^T W z, N = A^T W A + smoothing E, are scaled to a unit diagonal
(condition 2e3 instead of 3e5 for bicubic THB-splines of six levels), factorised, and solved again for the
residual as long as that correction shrinks, which brings back the digits that forming A^T W A loses.

Source: A. Bjoerck, Numerical Methods for Least Squares Problems, sections 2.9 and 6.6.5; C. de Boor,
A Practical Guide to Splines, chapter 14.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import SuperLU, splu

from thbcad.checks import (
    EPS,
    Floats,
    Integers,
    floats,
    read_only,
    rebuilt,
    require_number,
    require_type,
)
from thbcad.fitting.cell_samples import gauss_points
from thbcad.hierarchy import THBSpace
from thbcad.surfaces import THBSurface

EQUAL: Floats = read_only(1.0)  # weights that are left out: all 1
GREATEST_VALUE = 1e150  # its square is finite
MOST_SOLVES = 6  # two are enough for degree 3, degree 10 takes five


class Underdetermined(ValueError):
    """The samples do not determine every coefficient."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Values z_k at scattered points (u_k, v_k), with weights w_k >= 0 in least squares.

    u, v : (n,) float.  values : (n,) or (n, d) float.  weights : (n,) float, all 1 if left out.

    Raises
    ------
    ValueError : shapes that do not agree, numbers not finite or masked, values beyond 1e150, negative
        weights.
    """

    u: Floats
    v: Floats
    values: Floats
    weights: Floats = field(default_factory=lambda: EQUAL)

    def __post_init__(self) -> None:
        n = np.shape(self.values)[:1]
        arrays = {
            "u": self.u,
            "v": self.v,
            "values": self.values,
            "weights": np.ones(n) if self.weights is EQUAL else self.weights,
        }
        for name, given in arrays.items():
            array = read_only(given)
            if (
                array.shape[:1] != n
                or 0 in array.shape[1:]
                or not 1 <= array.ndim <= (2 if name == "values" else 1)
            ):
                shapes = ", ".join(f"{key} {np.shape(x)}" for key, x in arrays.items())
                raise ValueError(
                    f"samples need u (n,), v (n,), values (n,) or (n, d), weights (n,), got shapes {shapes}"
                )
            bad = ~np.isfinite(array)
            if bad.any():
                raise ValueError(f"{name}[{int(np.nonzero(bad)[0][0])}] is not finite")
            object.__setattr__(self, name, array)
        if self.values.size and abs(self.values).max() > GREATEST_VALUE:
            raise ValueError(f"values must not exceed {GREATEST_VALUE:g} in size: scale them")
        if (self.weights < 0).any():
            k = int(np.argmax(self.weights < 0))
            raise ValueError(f"weights must not be negative, got weights[{k}] = {self.weights[k]}")

    __reduce__ = rebuilt

    @classmethod
    def grid(cls, u: ArrayLike, v: ArrayLike, values: ArrayLike) -> Samples:
        """Return the samples of a height map: values (n_u, n_v) or (n_u, n_v, d) on the grid u x v."""
        u, v, values = (floats(x) for x in (u, v, values))
        if u.ndim != 1 or v.ndim != 1 or values.shape[:2] != (len(u), len(v)):
            raise ValueError(
                f"a height map over u {u.shape} and v {v.shape} needs values (n_u, n_v), got shape "
                f"{values.shape}"
            )
        return cls(
            np.repeat(u, len(v)), np.tile(v, len(u)), values.reshape(u.size * v.size, *values.shape[2:])
        )

    def __getitem__(self, chosen: slice | Integers | NDArray[np.bool_]) -> Samples:
        """Return some of the samples."""
        return Samples(self.u[chosen], self.v[chosen], self.values[chosen], self.weights[chosen])

    def __len__(self) -> int:
        return len(self.u)


def least_squares(space: THBSpace, samples: Samples, smoothing: float = 0.0) -> THBSurface:
    """Return the spline s of the space with the least weighted sum of squares plus thin-plate energy.

    Minimises  sum_k w_k |s(u_k, v_k) - z_k|^2 + smoothing * integral of (s_uu^2 + 2 s_uv^2 + s_vv^2) du dv,
    so that `smoothing` has the unit of a length squared in the parameters.

    Raises
    ------
    Underdetermined : the samples do not determine every coefficient (names a function).
    ValueError : samples outside the domain, a smoothing that is negative or not finite.
    """
    require_type("space", space, THBSpace)
    require_type("samples", samples, Samples)
    require_number("smoothing", smoothing, least=0, finite=True)
    a = space.collocation(samples.u, samples.v)
    weighted = csr_array((diags_array(samples.weights) @ a).T)
    energy = smoothing * thin_plate(space) if smoothing else csr_array((space.dim, space.dim))
    normal = weighted @ a + energy
    lu, scale = _factorised(normal, space, smoothing)
    coefficients = np.zeros((space.dim, *samples.values.shape[1:]))
    least = float("inf")
    for _ in range(MOST_SOLVES):
        gradient = weighted @ (samples.values - a @ coefficients) - energy @ coefficients
        correction = (scale * lu.solve((scale * gradient.T).T).T).T
        size = float(np.linalg.norm(correction))
        if size >= least:
            break
        coefficients = coefficients + correction
        least = size
    return THBSurface(space, coefficients)


def thin_plate(space: THBSpace) -> csr_array:
    """Return the energy matrix E, csr_array (dim, dim), with c^T E c = integral of (s_uu^2 + 2 s_uv^2 +
    s_vv^2) du dv.

    Gauss quadrature with p + 1 and q + 1 points on every leaf cell, which is exact.
    """
    u, v, weights = gauss_points(space)
    total = csr_array((space.dim, space.dim))
    for derivative, factor in (((2, 0), 1), ((1, 1), 2), ((0, 2), 1)):
        d = space.collocation(u, v, derivative)
        total = total + d.T @ (diags_array(factor * weights) @ d)
    return csr_array(total)


def _factorised(normal: csr_array, space: THBSpace, smoothing: float) -> tuple[SuperLU, Floats]:
    """Return (lu, s): the factors of S N S with unit diagonal, S = diag(s); refuse a singular matrix."""
    diagonal = normal.diagonal()
    if (diagonal == 0).any():
        empty = np.flatnonzero(diagonal == 0)
        raise Underdetermined(
            f"{len(empty)} of {space.dim} functions have no sample in their support, the first is function "
            f"{empty[0]} (level, i, j) = {tuple(space.functions[empty[0]].tolist())}; add samples there, "
            "refine less, or smooth"
        )
    scale = 1 / np.sqrt(diagonal)
    rounding = space.dim * EPS
    # the shift keeps the pivots of a singular matrix from being exactly zero; the second solve makes up for
    # it
    scaled = csc_array(diags_array(scale) @ normal @ diags_array(scale) + rounding * eye_array(space.dim))
    lu = splu(scaled, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    weak = np.random.default_rng(0).standard_normal(space.dim)
    for _ in range(
        2
    ):  # inverse iteration: towards the eigenvector of the least eigenvalue, which is 1 / |weak|
        weak = lu.solve(weak / np.linalg.norm(weak))
    if np.linalg.norm(weak) * 2 * rounding >= 1:
        k = int(np.argmax(np.abs(weak)))
        advice = f"choose another smoothing than {smoothing:g}" if smoothing else "smooth"
        raise Underdetermined(
            f"the samples do not determine function {k} (level, i, j) = "
            f"{tuple(space.functions[k].tolist())} apart from "
            f"its neighbours; add samples near it, refine less, or {advice}"
        )
    return lu, scale
