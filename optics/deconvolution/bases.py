"""Non-negative approximation in a basis: light F = P_r W P_c^T with coefficients W >= 0.

A one-dimensional basis is a matrix (n, m): column i holds the share of function i that falls in each of n
pixels.

Source: thesis 7.32-7.41; errata: the exponents of (7.36) start above -1, where they are integrable.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline
from scipy.special import betainc

from optics.etendue import (
    Approximation,
    Array,
    Kernel,
    Real,
    descend,
    kkt_residual,
    norm,
    require_target,
    scaled_bound,
)
from thbcad.checks import read_only, require_integer, require_number


@dataclass(frozen=True, eq=False)
class BasisBlur:
    """The map from coefficients to the image, W -> E * (P_r W P_c^T) / scale, whose rows sum to at most 1.

    rows : (n + k - 1, a).  columns : (m + l - 1, b), non-negative.  kernel : (k, l) taps
    """

    kernel: Kernel
    rows: Array
    columns: Array

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

    def reach(self, shape: tuple[int, ...]) -> Array:
        """Return what the coefficients bring onto the image, (a, b)."""
        return self.rows.T @ self.kernel.reach(shape) @ self.columns / self.scale


def approximate_in_basis(
    kernel: Kernel,
    target: ArrayLike,
    rows: Array,
    columns: Array,
    tolerance: float = 1e-5,
    most_iterations: int = 5000,
) -> Approximation:
    """Return light in the cone of a tensor-product basis that minimises ||E * F - G||^2, with its
    certificate.

    rows : (n + k - 1, a).  columns : (m + l - 1, b), the basis in both directions, for a target (n, m) and
        kernel (k, l)
    The lower bound holds for light of this basis, the KKT residual is that of the coefficients.

    Raises
    ------
    ValueError : as `optics.etendue.approximation.approximate`; bases that are negative or do not fit the
        target.
    """
    goal = require_target(kernel, target)
    require_number("tolerance", tolerance, above=0.0)
    require_integer("most_iterations", most_iterations, 1)
    for name, basis, length in zip(("rows", "columns"), (rows, columns), kernel.light_shape(goal.shape)):
        if np.ndim(basis) != 2 or len(basis) != length or not (np.asarray(basis) >= 0).all():
            raise ValueError(
                f"{name} must hold non-negative columns of {length} pixels of light, got shape "
                f"{np.shape(basis)}"
            )
    blur, top = BasisBlur(kernel, np.asarray(rows, float), np.asarray(columns, float)), goal.max()
    start = np.zeros((blur.rows.shape[1], blur.columns.shape[1]))
    weights, steps = descend(blur, start, goal / top, tolerance, most_iterations)
    weights = weights * top
    image = blur.apply(weights)
    error = goal - image
    residual = norm(error) / norm(goal)
    bound = min(residual, scaled_bound(blur, goal, error))
    light = blur.light(weights) / blur.scale
    return Approximation(
        read_only(light), read_only(image), residual, kkt_residual(blur, weights, goal), bound, steps
    )


def deltas(pixels: int, spacing: int = 1) -> Array:
    """Return shifted Kronecker deltas, one every `spacing` pixels (7.43)."""
    return np.eye(pixels)[:, ::spacing]


def beta(pixels: int, greatest: tuple[float, float], counts: tuple[int, int]) -> Array:
    """Return Beta distributions over the row of pixels (7.36), (n, N_a N_b): x^(a - 1) (1 - x)^(b - 1) / B(a,
    b).

    greatest : (A, B).  counts : (N_a, N_b).  a = i A / N_a for i = 1 .. N_a, b = j B / N_b for j = 1 .. N_b
    """
    a, b = (np.arange(1, count + 1) * most / count for most, count in zip(greatest, counts))
    a, b = (x.ravel() for x in np.meshgrid(a, b, indexing="ij"))
    return np.diff(betainc(a, b, np.linspace(0, 1, pixels + 1)[:, None]), axis=0)


def irwin_hall(pixels: int, terms: int, spacing: float = 1.0) -> Array:
    """Return shifted densities of the sum of `terms` uniform variables of width `spacing` (7.37): cardinal
    B-splines.

    The functions are `spacing` pixels apart and all those that meet the row of pixels; inside their sum is
    `spacing` per pixel and function area 1.
    """
    return _shifted(pixels, terms, spacing, spacing)


def bates(pixels: int, terms: int, width: float, spacing: float) -> Array:
    """Return shifted densities of the mean of `terms` uniform variables of the given width, `spacing` pixels
    apart."""
    return _shifted(pixels, terms, width / terms, spacing)


def _shifted(pixels: int, terms: int, knot: float, spacing: float) -> Array:
    require_integer("terms", terms, 1)
    require_number("spacing", spacing, above=0.0)
    require_number("width", knot, above=0.0)
    first = -terms * knot + spacing
    starts = first + spacing * np.arange(int(np.ceil((pixels - first) / spacing)))
    share = BSpline.basis_element(np.arange(terms + 1.0), extrapolate=False).antiderivative()
    edges = (np.arange(pixels + 1)[:, None] - starts) / knot
    return np.diff(share(np.clip(edges, 0, terms)) / share(terms), axis=0)
