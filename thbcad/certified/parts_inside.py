"""What of rectangular cells lies inside an outline: which cells may hold points of it, points that it holds
for certain, and bounds over no more than the part inside.

With the lengths s of `Outline`, that count from where its corners begin and are 1 on their rim,

    q(x, y) = 1 - sx^2 - sy^2

is at least 0 at the points inside of a cell in a corner.  A convex function of a vector of polynomials has
values v_ij at its Bernstein coefficients; with the coefficients q_ij of q it is inside at most

    max_ij (v_ij + mu q_ij)    for every mu >= 0,

and on the rim, where q = 0, for every mu.  With the ratio of the slopes across the rim for mu this differs
from the greatest value by the square of the cell's size, and for a paraboloid over a disk by nothing.

Source: S. Boyd, L. Vandenberghe, Convex Optimization, section 5.1 (Lagrange's dual function).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from thbcad.checks import EPS, Floats
from thbcad.outlines import Outline

ROUNDINGS = 64  # more than a length s and its square take
CORNERS = (0.0, 0.0, 1.0, 1.0), (0.0, 1.0, 0.0, 1.0)  # of a cell, relative to it

Booleans = NDArray[np.bool_]


@dataclass(frozen=True)
class Region:
    """An outline with corners that are cut off, or no more than the rim of these corners.

    outline : Outline, not a rectangle.  rim : whether only points on the rim of the corners count
    """

    outline: Outline
    rim: bool = False

    @property
    def slack(self) -> float:
        """What rounding does to a length s, its square and q, at most."""
        (hx, hy), (cx, cy) = self.outline.half_width, self.outline.corners
        return ROUNDINGS * EPS * (1 + max(hx / cx, hy / cy))

    def may_hold(self, box: Floats) -> Booleans:
        """Return which cells are not proven to lie outside, or off the rim, (n,).

        box : (2, 2, n) float, box[0] = (x, y) of the lower left corners, box[1] of the upper right ones.
        """
        nearest = np.where(box[0] * box[1] <= 0, 0.0, np.abs(box).min(axis=0))
        near = np.maximum(self._lengths(nearest), 0.0)
        held: Booleans = (near**2).sum(axis=0) <= 1 + self.slack
        return held & self._reaches(box) if self.rim else held

    def points(self, box: Floats) -> tuple[Floats, Booleans, Booleans]:
        """Return a point of every cell for each corner, relative to the cell, with (moved, inside).

        points : (2, 4, n) float from 0 to 1.  moved : (4, n), those that lie just inside the rim, as their
        corner is outside.  inside : (4, n), those that are proven to count.
        """
        low, high = box
        corner = np.stack([box[[0, 0, 1, 1], 0], box[[0, 1, 0, 1], 1]])
        s = np.maximum(self._lengths(corner), 0.0)
        beside = (s > 0).all(axis=0) & ((s**2).sum(axis=0) > 1 - self.slack)
        cell = np.nonzero(beside)[1]
        nearest = np.where(low * high <= 0, 0.0, np.abs(box).min(axis=0))[:, cell]
        start = np.maximum(self._lengths(nearest), 0.0)
        step = s[:, beside] - start
        # |start + t step|^2 = 1 - 2 slack
        a, b = (step**2).sum(axis=0), (start * step).sum(axis=0)
        c = (start**2).sum(axis=0) - (1 - 2 * self.slack)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.nan_to_num(-c / (b + np.sqrt(np.maximum(b * b - a * c, 0.0))))
        x = np.sign(corner[:, beside]) * self._from_lengths(start + np.clip(t, 0.0, 1.0) * step)
        width = high - low
        at: Floats = np.repeat(np.reshape(CORNERS, (2, 4, 1)), box.shape[-1], axis=2)
        at[:, beside] = np.clip((x - low[:, cell]) / width[:, cell], 0.0, 1.0)
        met = np.maximum(self._lengths(low[:, cell] + at[:, beside] * width[:, cell]), 0.0)
        square = (met**2).sum(axis=0)
        counts = ~beside & (not self.rim)
        counts[beside] = (square <= 1 - self.slack) & ((square >= 1 - 3 * self.slack) | (not self.rim))
        return at, beside, counts

    def most(self, values: Floats, box: Floats) -> Floats:
        """Return the bound of max_ij (v_ij + mu q_ij) of every cell, (n,), with a good mu.

        values : (p + 1, q + 1, n) float, of a convex function at the Bernstein coefficients.
        """
        out: Floats = values.max(axis=(0, 1))
        ends = self._ends(box)
        cut = self._reaches(box) & (self.outline.is_ellipse | (ends.min(axis=(0, 1)) >= 0))
        if cut.any():
            v, degrees = values[..., cut], [n - 1 for n in values.shape[:2]]
            x, y = (_square(ends[0, d, cut], ends[1, d, cut], p) for d, p in enumerate(degrees))
            q = 1 - x[:, None] - y
            across, height = q - q.mean(axis=(0, 1)), v - v.mean(axis=(0, 1))
            size = (across**2).sum(axis=(0, 1))
            mu = -(across * height).sum(axis=(0, 1)) / np.where(size > 0, size, np.inf)
            exact = min(degrees) >= 2  # else q_ij belong to a greater function
            mu = mu if self.rim and exact else np.maximum(mu, 0.0)
            error = np.abs(mu) * self.slack + 4 * EPS * np.abs(v).max(axis=(0, 1))
            out[cut] = np.minimum(out[cut], (v + mu * q).max(axis=(0, 1)) + error)
        return out

    def _lengths(self, points: Floats) -> Floats:
        """Return s at points (2, ...), negative before the corners begin."""
        h, c = (np.reshape(pair, (2,) + (1,) * (points.ndim - 1)) for pair in self._sizes)
        return np.asarray((np.abs(points) - (h - c)) / c)

    def _from_lengths(self, s: Floats) -> Floats:
        h, c = (np.reshape(pair, (2,) + (1,) * (s.ndim - 1)) for pair in self._sizes)
        return np.asarray(h - c + c * s)

    @property
    def _sizes(self) -> tuple[Floats, Floats]:
        return np.array(self.outline.half_width), np.array(self.outline.corners)

    def _ends(self, box: Floats) -> Floats:
        """Return s at both ends of every cell, counted from the side on which its middle lies, (2, 2, n)."""
        h, c = (pair[:, None] for pair in self._sizes)
        side = np.where(box.sum(axis=0) < 0, -1.0, 1.0)
        return np.asarray((side * box - (h - c)) / c)

    def _reaches(self, box: Floats) -> Booleans:
        """Return which cells are not proven to lie off the rim and inside it."""
        far = np.maximum(self._lengths(np.abs(box).max(axis=0)), 0.0)
        return np.asarray((far > 0).all(axis=0) & ((far**2).sum(axis=0) > 1 - 4 * self.slack))


def _square(low: Floats, high: Floats, degree: int) -> Floats:
    """Return Bernstein coefficients of s^2 between low and high, (degree + 1, n); below degree 2 those of a
    function that is nowhere greater."""
    if degree == 0:
        return np.where(low * high <= 0, 0.0, np.minimum(low**2, high**2))[None]
    if degree == 1:  # the tangent in the middle
        middle = (low + high) / 2
        return np.stack([middle * (2 * end - middle) for end in (low, high)])
    pairs = [(comb(degree - k, 2), k * (degree - k), comb(k, 2)) for k in range(degree + 1)]
    return np.stack([a * low**2 + b * low * high + c * high**2 for a, b, c in pairs]) / comb(degree, 2)
