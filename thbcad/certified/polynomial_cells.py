"""Polynomials on rectangular cells by their Bernstein coefficients, and what of the cells counts.

On a cell a vector of polynomials is a convex combination of its coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import comb
from typing import TypeVar

import numpy as np

from thbcad.certified.parts_inside import Region
from thbcad.checks import EPS, Bools, Floats, Integers
from thbcad.outlines import Outline
from thbcad.splines import halves

BESIDE = 1e-12  # of a half-width: where a graph may end beyond its outline, by rounding
TINY = float(np.finfo(np.float64).tiny)  # above every error of a subnormal result

Size = TypeVar("Size", float, Floats)


@dataclass(frozen=True, eq=False)
class Cells:
    """Vectors of d polynomials on n cells, by their Bernstein coefficients of degree (p, q).

    coefficients : (d, p + 1, q + 1, n) float
    box : (2, 2, n) float, box[0] = (u, v) of the lower left corners, box[1] of the upper right ones
    magnitude : (d,) float, no coefficient is greater
    error : (d,) float, bounds of the rounding errors of the coefficients
    region : Region or None, what counts of the cells; None is all
    """

    coefficients: Floats
    box: Floats
    magnitude: Floats
    error: Floats
    region: Region | None = None

    def negated(self) -> Cells:
        """Return the negative polynomials."""
        return replace(self, coefficients=-self.coefficients)

    def take(self, chosen: Bools) -> Cells:
        """Return the chosen cells; chosen : (n,) bool."""
        return replace(self, coefficients=self.coefficients[..., chosen], box=self.box[..., chosen])

    def inside(self) -> Cells:
        """Return the cells that are not proven to lie outside the region."""
        return self if self.region is None else self.take(self.region.may_hold(self.box))

    def met(self) -> tuple[Floats, Bools]:
        """Return the vectors at the four corners, (d, 4, n), and which count, (4, n).

        Corners (0, 0), (0, 1), (1, 0), (1, 1).  For those beside a region stand points just inside its rim.
        """
        vectors = corners(self.coefficients)
        if self.region is None:
            return vectors, np.ones(vectors.shape[1:], bool)
        (s, t), moved, counts = self.region.points(self.box, self._crossed)
        p, q = (n - 1 for n in self.coefficients.shape[1:3])
        net = self.coefficients[..., np.nonzero(moved)[1]]
        by_s, by_t = _bernstein_functions(p, s), _bernstein_functions(q, t)
        vectors[:, moved] = np.einsum("im,dijm,jm->dm", by_s, net, by_t)
        return vectors, counts

    def corners_inside(self) -> Bools:
        """Return which of the four corners themselves are proven to lie inside the region, (4, n)."""
        if self.region is None:
            return np.ones((4, self.box.shape[-1]), bool)
        _, moved, counts = self.region.points(self.box, self._crossed)
        return counts & ~moved

    def position(self, corner: int, k: int) -> tuple[float, float]:
        """Return (u, v) of a point that `met` stands for, of cell k."""
        u, v = self.box[corner // 2, 0, k], self.box[corner % 2, 1, k]
        if self.region is not None:
            one = self.take(np.arange(self.box.shape[-1]) == k)
            at, moved, _ = self.region.points(one.box, one._crossed)
            if moved[corner, 0]:
                low, high = self.box[..., k]
                u, v = low + at[:, np.count_nonzero(moved[:corner])] * (high - low)
        return float(u), float(v)

    def most(self, values: Floats) -> Floats:
        """Return the most that a convex function of the vectors reaches in every cell, (n,), by its values at
        the coefficients, (p + 1, q + 1, n)."""
        if self.region is None:
            most: Floats = values.max(axis=(0, 1))
            return most
        return self.region.most(values, self.box, self._crossed)

    @cached_property
    def _crossed(self) -> Integers:
        """The cells that the rim of the region may cross."""
        return np.flatnonzero(self.region is not None and self.region.may_cross(self.box))

    def quartered(self) -> Cells:
        """Return the four quarters of every cell, by de Casteljau's algorithm written as a matrix."""
        cells = self
        for axis in (0, 1):
            degree = cells.coefficients.shape[axis + 1] - 1
            parts = [
                np.moveaxis(np.tensordot(half, cells.coefficients, (1, axis + 1)), 0, axis + 1)
                for half in halves(degree)
            ]
            low, high = cells.box.copy(), cells.box.copy()
            low[1, axis] = high[0, axis] = cells.box[0, axis] + (cells.box[1, axis] - cells.box[0, axis]) / 2
            error = cells.error + rounding(degree + 1, cells.magnitude)
            cells = replace(
                cells,
                coefficients=np.concatenate(parts, -1),
                box=np.concatenate([low, high], -1),
                error=error,
            )
        return cells


def rounding(count: int, size: Size) -> Size:
    """Return the allowance for a count of roundings of numbers of this size."""
    return count * (EPS * size + TINY * (size > 0))


def within(pieces: Iterable[Cells], outline: Outline | None) -> Iterator[Cells]:
    """Yield cells of which only what lies within an outline counts; None leaves them as they are.

    Raises ValueError : cells beyond the rectangle of the outline.
    """
    if outline is None:
        return iter(pieces)
    inner = _require_inside(pieces, outline)
    return inner if outline.is_rectangle else confined(inner, Region(outline))


def _require_inside(pieces: Iterable[Cells], outline: Outline) -> Iterator[Cells]:
    """Yield cells; raise ValueError for those that reach beyond the rectangle of an outline."""
    for cells in pieces:
        reach = np.abs(cells.box).max(axis=(0, 2))
        if (reach > (1 + BESIDE) * np.array(outline.half_width)).any():
            x, y = outline.half_width
            raise ValueError(
                f"the surface goes on beyond its outline, to {reach[0]:g} and {reach[1]:g} mm; "
                f"give its segment ({-x:g}, {x:g}), ({-y:g}, {y:g})"
            )
        yield cells


def confined(pieces: Iterable[Cells], region: Region, slip: float = 0.0) -> Iterator[Cells]:
    """Yield cells of which only a region counts; slip : what is added to the errors."""
    for cells in pieces:
        p, q = (n + 1 for n in cells.coefficients.shape[1:3])
        error = cells.error + rounding(2 * p * q, cells.magnitude) + slip  # of values between the corners
        yield replace(cells, region=region, error=error)


def corners(values: Floats) -> Floats:
    """Return the corners (0, 0), (0, 1), (1, 0), (1, 1) of coefficients (..., p + 1, q + 1, n), as (..., 4,
    n)."""
    return values[..., [0, 0, -1, -1], [0, -1, 0, -1], :]


def _bernstein_functions(degree: int, x: Floats) -> Floats:
    """Return the Bernstein functions of a degree at x, (degree + 1, n)."""
    return np.stack([comb(degree, k) * x**k * (1 - x) ** (degree - k) for k in range(degree + 1)])
