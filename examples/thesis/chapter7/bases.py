"""Non-negative approximation in a basis: light F = P_r W P_c^T with coefficients W >= 0.

A one-dimensional basis is a matrix (n, m): column i holds the integrals of function i over n pixels.

Source: thesis 7.32-7.41; errata: the exponents of (7.36) start above -1, where they are integrable.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline
from scipy.special import betainc

from optics.designing.etendue import (
    Approximation,
    Kernel,
    Real,
    descend,
    kkt_residual,
    norm,
    require_target,
    scaled_bound,
)
from thbcad.checks import Floats, read_only, require_integer, require_number


@dataclass(frozen=True, eq=False)
class BasisBlur:
    """The map from coefficients to the image, W -> E * (P_r W P_c^T) / scale, whose rows sum to at most 1.

    rows : (n + k - 1, a).  columns : (m + l - 1, b), non-negative.  kernel : (k, l) taps
    """

    kernel: Kernel
    rows: Floats
    columns: Floats

    @cached_property
    def scale(self) -> float:
        """The greatest sum of a row, max of E * (P_r 1 P_c^T)."""
        return float(self.kernel.apply(np.outer(self.rows.sum(axis=1), self.columns.sum(axis=1))).max())

    def light(self, weights: Real) -> Real:
        """Return P_r W P_c^T.  weights : (a, b)."""
        return self.rows @ weights @ self.columns.T

    def apply(self, weights: Real) -> Real:
        """Return the image, (n, m).  weights : (a, b)."""
        return self.kernel.apply(self.light(weights)) / self.scale

    def adjoint(self, image: Real) -> Real:
        """Return the transposed map of an image, (a, b)."""
        return self.rows.T @ self.kernel.adjoint(image) @ self.columns / self.scale

    def column_sums(self, shape: tuple[int, ...]) -> Floats:
        """Return A^T 1, what the coefficients bring onto an image of this shape, (a, b)."""
        return self.rows.T @ self.kernel.column_sums(shape) @ self.columns / self.scale


def approximate_in_basis(
    kernel: Kernel,
    target: ArrayLike,
    rows: Floats,
    columns: Floats,
    tolerance: float = 1e-5,
    most_iterations: int = 5000,
) -> Approximation:
    """Return light F in the cone of a tensor-product basis that minimises ||E * F - G||^2.

    rows : (n + k - 1, a), the basis across the rows, for a target (n, m) and a kernel (k, l)
    columns : (m + l - 1, b), the basis across the columns

    Of its certificate the lower bound holds for light of this basis, the KKT residual is that of the
    coefficients.

    Raises ValueError : as `etendue.approximation.approximate`; bases that are negative or do not fit the
        target.
    """
    goal = require_target(kernel, target)
    require_number("tolerance", tolerance, above=0.0)
    require_integer("most_iterations", most_iterations, 1)
    n, m = kernel.light_shape(goal.shape)
    blur = BasisBlur(kernel, _basis("rows", rows, n), _basis("columns", columns, m))
    top = goal.max()
    start = np.zeros((blur.rows.shape[1], blur.columns.shape[1]))
    weights, steps = descend(blur, start, goal / top, tolerance, most_iterations)
    weights = weights * top
    image = blur.apply(weights)
    error = goal - image
    residual = norm(error) / norm(goal)
    return Approximation(
        solution=read_only(blur.light(weights) / blur.scale),
        image=read_only(image),
        residual=residual,
        kkt=kkt_residual(blur, weights, goal),
        lower_bound=min(residual, scaled_bound(blur, goal, error)),
        iterations=steps,
    )


def _basis(name: str, values: ArrayLike, pixels: int) -> Floats:
    """Return a basis as floats.

    Raises ValueError : it is negative or has another number of pixels.
    """
    basis = np.asarray(values, dtype=np.float64)
    if basis.ndim != 2 or len(basis) != pixels or not (basis >= 0).all():
        raise ValueError(
            f"{name} must hold non-negative columns of {pixels} pixels of light, got shape {basis.shape}"
        )
    return basis


def deltas(pixels: int, spacing: int = 1) -> Floats:
    """Return shifted Kronecker deltas, one every `spacing` pixels (7.43)."""
    return np.eye(pixels)[:, ::spacing]


def beta(pixels: int, greatest: tuple[float, float], counts: tuple[int, int]) -> Floats:
    """Return Beta distributions x^(a - 1) (1 - x)^(b - 1) / B(a, b) on the row of pixels (7.36).

    greatest : (A, B)
    counts : (N_a, N_b); a = i A / N_a for i = 1 .. N_a, b = j B / N_b for j = 1 .. N_b

    Returns (n, N_a N_b).
    """
    a, b = (np.arange(1, count + 1) * most / count for most, count in zip(greatest, counts))
    a, b = (x.ravel() for x in np.meshgrid(a, b, indexing="ij"))
    return np.diff(betainc(a, b, np.linspace(0, 1, pixels + 1)[:, None]), axis=0)


def irwin_hall(pixels: int, terms: int, spacing: float = 1.0) -> Floats:
    """Return shifted densities of the sum of `terms` uniform variables of width `spacing` (7.37).

    They are cardinal B-splines of area 1, `spacing` pixels apart: all those that meet the row of pixels.
    Inside the row their sum is 1 / `spacing` per pixel.
    """
    return _shifted(pixels, terms, spacing, spacing)


def bates(pixels: int, terms: int, width: float, spacing: float) -> Floats:
    """Return densities of the mean of `terms` uniform variables of this width, `spacing` pixels apart."""
    return _shifted(pixels, terms, width / terms, spacing)


def _shifted(pixels: int, terms: int, knot: float, spacing: float) -> Floats:
    require_integer("terms", terms, 1)
    require_number("spacing", spacing, above=0.0)
    require_number("width", knot, above=0.0)
    first = -terms * knot + spacing
    starts = first + spacing * np.arange(int(np.ceil((pixels - first) / spacing)))
    integral = BSpline.basis_element(np.arange(terms + 1.0), extrapolate=False).antiderivative()
    edges = (np.arange(pixels + 1)[:, None] - starts) / knot
    return np.diff(integral(np.clip(edges, 0, terms)) / integral(terms), axis=0)
