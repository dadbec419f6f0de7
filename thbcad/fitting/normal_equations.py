"""The normal equations of least squares in a THB space, with thin-plate smoothing.

N c = A^T W z with N = A^T W A + smoothing E are scaled to a unit diagonal (condition 2e3 instead of 3e5 for
bicubic THB-splines of six levels), factorised, and solved again for the residual as long as that correction
shrinks, which brings back the digits that forming A^T W A loses.

Source: A. Bjoerck, Numerical Methods for Least Squares Problems, sections 2.9 and 6.6.5; C. de Boor,
A Practical Guide to Splines, chapter 14.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array, eye_array, kron
from scipy.sparse.linalg import SuperLU, splu

from thbcad.checks import EPS, Bools, Floats
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector, gauss_rule

MOST_SOLVES = 6  # two are enough for degree 3, degree 10 takes five
THIN_PLATE = ((2, 0), 1), ((1, 1), 2), ((0, 2), 1)  # derivatives by u and v, and factors of their squares
LEAST_EXPONENT = -511  # of four, among float64 numbers with all their digits


class Underdetermined(ValueError):
    """The samples do not determine every coefficient.

    >>> kv = KnotVector.uniform(degree=1, spans=1)
    >>> least_squares(THBSpace(kv, kv), Samples([0.5], [0.5], [1.0]))
    Traceback (most recent call last):
    ...
    thbcad.fitting.normal_equations.Underdetermined: the samples do not determine ...
    """


@dataclass(frozen=True, eq=False)
class Factors:
    """S N S = L U, with the diagonal S that makes the diagonal of S N S one."""

    lu: SuperLU
    scale: Floats  # (dim,), the diagonal of S

    def solve(self, right: Floats) -> Floats:
        """Return N^-1 right, for right sides (dim,) or (dim, m)."""
        result: Floats = (self.scale * self.lu.solve((self.scale * right.T).T).T).T
        return result


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Least squares  sum_k w_k |(A c - z)_k|^2 + smoothing c^T E c  of one space and one set of samples.

    Values and weights are held as multiples of powers of four, so that squares of great values stay finite.

    collocation : A, csr_array (n, dim).  energy : E, csr_array (dim, dim).
    values : z / height, (n,) or (n, d).  weights : w / unit, (n,).
    """

    space: THBSpace
    collocation: csr_array
    energy: csr_array
    values: Floats
    weights: Floats
    height: float
    unit: float

    @classmethod
    def of(
        cls, space: THBSpace, collocation: csr_array, energy: csr_array, values: Floats, weights: Floats
    ) -> NormalEquations:
        """Return the equations of values z, (n,) or (n, d), and weights w, (n,)."""
        height, unit = _power_of_four(values), _power_of_four(weights)
        return cls(space, collocation, energy, values / height, weights / unit, height, unit)

    def with_weights(self, weights: Floats) -> NormalEquations:
        """Return the equations of the same samples with other weights w, (n,)."""
        unit = _power_of_four(weights)
        return replace(self, weights=weights / unit, unit=unit)

    @cached_property
    def weighted(self) -> csr_array:
        """A^T W / unit, csr_array (dim, n)."""
        return csr_array((diags_array(self.weights) @ self.collocation).T)

    @cached_property
    def gram(self) -> csr_array:
        """A^T W A / unit, csr_array (dim, dim)."""
        return csr_array(self.weighted @ self.collocation)

    def factors(self, smoothing: float) -> Factors:
        """Return the factors of N / unit."""
        normal = self.gram + smoothing / self.unit * self.energy
        return _factorised(normal, self.space, smoothing)

    def solution(self, smoothing: float, factors: Factors | None = None) -> Floats:
        """Return the coefficients of least sum over `height`, (dim,) or (dim, d)."""
        factors = factors or self.factors(smoothing)
        coefficients = np.zeros((self.space.dim, *self.values.shape[1:]))
        least = float("inf")
        for _ in range(MOST_SOLVES):
            gradient = self.weighted @ (self.values - self.collocation @ coefficients)
            if smoothing:
                gradient = gradient - smoothing / self.unit * self.energy @ coefficients
            correction = factors.solve(gradient)
            size = float(np.linalg.norm(correction))
            if size >= least:
                break
            coefficients = coefficients + correction
            least = size
        return coefficients

    def misfit(self, coefficients: Floats) -> float:
        """Return sum_k w_k |(A c - z)_k|^2 / (unit height^2), for coefficients over `height`."""
        residual = (self.values - self.collocation @ coefficients).reshape(len(self.values), -1)
        return float(self.weights @ (residual**2).sum(axis=1))


def _power_of_four(numbers: Floats) -> float:
    """Return the greatest power of four that is at most the greatest magnitude, 1 if all are zero.

    Roots of numbers divided by it are rounded as before.
    """
    greatest = float(np.abs(numbers).max(initial=0))
    return 4.0 ** max((math.frexp(greatest)[1] - 1) // 2, LEAST_EXPONENT) if greatest else 1.0


def thin_plate(
    space: THBSpace,
    cells: Bools | None = None,
    rows: Bools | None = None,
) -> csr_array:
    """Return rows of the energy matrix E, csr_array (dim, dim), with c^T E c = integral of (s_uu^2 + 2 s_uv^2
    + s_vv^2) du dv.

    cells : a mask of the leaf cells over which it is taken; None is all of them.  rows : of E; None is all.
    Gauss quadrature with p + 1 and q + 1 points on every leaf cell, which is exact.  Of cells of one level
    the integrals are products of those in u and in v.
    """
    if cells is None and rows is None and len(np.unique(space.cells[:, 0])) == 1:
        by_u, by_v = (_integrals(kv) for kv in (space.embedding.kv_u, space.embedding.kv_v))
        return csr_array(sum(factor * kron(by_u[a], by_v[b]) for (a, b), factor in THIN_PLATE))
    u, v, weights, cell = space.quadrature()
    if cells is not None:
        u, v, weights = (row[cells[cell]] for row in (u, v, weights))
    total = csr_array((space.dim if rows is None else rows.sum(), space.dim))
    for derivative, factor in THIN_PLATE:
        d = space.collocation(u, v, derivative)
        total = total + (d if rows is None else d[:, rows]).T @ (diags_array(factor * weights) @ d)
    return csr_array(total)


def _integrals(kv: KnotVector) -> list[csr_array]:
    """Return the integrals of products of two basis functions, and of their first and second derivatives."""
    points, weights = gauss_rule(kv.breaks, kv.degree + 1)
    slopes = [kv.collocation(points, order) for order in range(3)]
    return [csr_array(d.T @ (diags_array(weights) @ d)) for d in slopes]


def symmetric_lu(matrix: csr_array) -> SuperLU:
    """Return the factors of a symmetric positive definite matrix."""
    options = {"SymmetricMode": True}
    return splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def _factorised(normal: csr_array, space: THBSpace, smoothing: float) -> Factors:
    """Return the factors of a normal matrix; refuse a singular one."""
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
    # the shift keeps the pivots of a singular matrix from being exactly zero; further solves make up for it
    lu = symmetric_lu(diags_array(scale) @ normal @ diags_array(scale) + rounding * eye_array(space.dim))
    # inverse iteration: towards the eigenvector of the least eigenvalue, which is 1 / |weak|
    weak = np.random.default_rng(0).standard_normal(space.dim)
    for _ in range(2):
        weak = lu.solve(weak / np.linalg.norm(weak))
    if not np.linalg.norm(weak) * 2 * rounding < 1:
        k = int(np.argmax(np.abs(weak)))
        advice = f"choose another smoothing than {smoothing:g}" if smoothing else "smooth"
        raise Underdetermined(
            f"the samples do not determine function {k} (level, i, j) = "
            f"{tuple(space.functions[k].tolist())} apart from "
            f"its neighbours; add samples near it, refine less, or {advice}"
        )
    return Factors(lu, scale)
