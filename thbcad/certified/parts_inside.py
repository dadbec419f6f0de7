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

from dataclasses import dataclass
from math import comb

import numpy as np

from thbcad.checks import EPS, Bools, Floats, Integers
from thbcad.outlines import Outline

ROUNDINGS = 64  # more than a length s and its square take


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

    def may_hold(self, box: Floats) -> Bools:
        """Return which cells are not proven to lie outside, or off the rim, (n,).

        box : (2, 2, n) float, box[0] = (x, y) of the lower left corners, box[1] of the upper right ones.
        """
        x, y = np.maximum(self._lengths(_nearest(box)), 0.0)
        held: Bools = x**2 + y**2 <= 1 + self.slack
        return held & self.may_cross(box) if self.rim else held

    def may_cross(self, box: Floats) -> Bools:
        """Return which cells are not proven to lie off the rim and inside it, (n,)."""
        x, y = self._lengths(np.maximum(-box[0], box[1]))
        return np.asarray((x > 0) & (y > 0) & (x**2 + y**2 > 1 - 4 * self.slack))

    def points(self, box: Floats, crossed: Integers) -> tuple[Floats, Bools, Bools]:
        """Return (at, moved, inside) of a point of every cell for each corner.

        crossed : the cells that `may_cross`.
        moved : (4, n), those that lie just inside the rim, as their corner is outside.
        at : (2, m) float from 0 to 1, where these are in their cells, in the order of `moved`.
        inside : (4, n), those that are proven to count.
        """
        low, high = part = box[..., crossed]
        corner = np.stack([part[[0, 0, 1, 1], 0], part[[0, 1, 0, 1], 1]])
        s = np.maximum(self._lengths(corner), 0.0)
        beside = (s > 0).all(axis=0) & ((s**2).sum(axis=0) > 1 - self.slack)
        cell = np.nonzero(beside)[1]
        start = np.maximum(self._lengths(_nearest(part)[:, cell]), 0.0)
        step = s[:, beside] - start
        # |start + t step|^2 = 1 - 2 slack
        a, b = (step**2).sum(axis=0), (start * step).sum(axis=0)
        c = (start**2).sum(axis=0) - (1 - 2 * self.slack)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.nan_to_num(-c / (b + np.sqrt(np.maximum(b * b - a * c, 0.0))))
        x = np.sign(corner[:, beside]) * self._from_lengths(start + np.clip(t, 0.0, 1.0) * step)
        width = (high - low)[:, cell]
        at = np.clip((x - low[:, cell]) / width, 0.0, 1.0)
        square = (np.maximum(self._lengths(low[:, cell] + at * width), 0.0) ** 2).sum(axis=0)
        moved, counts = np.zeros((4, box.shape[-1]), bool), np.full((4, box.shape[-1]), not self.rim)
        moved[:, crossed] = beside
        counts[moved] = (square <= 1 - self.slack) & ((square >= 1 - 3 * self.slack) | (not self.rim))
        return at, moved, counts

    def most(self, values: Floats, box: Floats, crossed: Integers) -> Floats:
        """Return the bound of max_ij (v_ij + mu q_ij) of every cell, (n,), with a good mu.

        values : (p + 1, q + 1, n) float, of a convex function at the Bernstein coefficients.
        crossed : the cells that `may_cross`.
        """
        out: Floats = values.max(axis=(0, 1))
        ends = self._ends(box[..., crossed])
        apart = self.outline.is_ellipse | (ends.min(axis=(0, 1)) >= 0)
        if apart.any():
            cut, ends = crossed[apart], ends[..., apart]
            v, degrees = values[..., cut], [n - 1 for n in values.shape[:2]]
            x, y = (_square(ends[0, d], ends[1, d], p) for d, p in enumerate(degrees))
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


def _nearest(box: Floats) -> Floats:
    """Return the distances in x and y from the middle to the nearest point of every cell, (2, n)."""
    return np.asarray(np.maximum(np.maximum(box[0], -box[1]), 0.0))


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
