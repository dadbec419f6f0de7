"""Rims of moulded bodies: fitted pieces, the area within, where curves cross the knot lines of a surface."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats, Integers
from thbcad.lens import FreeformSurface, Rim
from thbcad.outlines import RimPiece, cross, kinks
from thbcad.splines import KnotVector, gauss_rule

SAMPLES = 4096  # of a rim on which crossings with knot lines are looked for
ILLINOIS = 20  # steps to a crossing between two samples, which needs about five
CROSSED = 1e-13  # mm, of a curve beside the line that it crosses
NODES = 12  # of the Gauss rule in every span of a rim
Points = Callable[[Floats], Floats]  # of parameters (n,), returns (n, 3), mm


@dataclass(frozen=True, eq=False)
class Lines:
    """Knot lines of a surface, (n,) each: x (axis 0) or y (axis 1) = level, mm, and how often a curve that
    crosses one needs a knot there."""

    level: Floats
    count: Integers
    axis: Integers


@dataclass(frozen=True, eq=False)
class FittedPiece:
    """A piece of a rim, a spline (x, y, z) of t."""

    kv: KnotVector
    poles: Floats

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the greatest parameter."""
        return self.kv.domain

    def __call__(self, t: ArrayLike, derivative: int = 0) -> tuple[Floats, Floats]:
        """Return (x, y), or its first derivative, at parameters t, (n,) each."""
        x, y, _ = np.asarray(self.kv.collocation(np.asarray(t), derivative) @ self.poles).T
        return x, y

    def rule(self, x: Floats, y: Floats, degree: int) -> tuple[Floats, Floats]:
        """Return nodes and weights of Gauss rules in the spans, between which it crosses no knot line."""
        return gauss_rule(self.kv.breaks, NODES)

    def height(self, t: Floats) -> Floats:
        """Return z at parameters t, (n,)."""
        return np.asarray(self.kv.collocation(t) @ self.poles[:, 2])


@dataclass(frozen=True, eq=False)
class Foot:
    """Where a wall meets a surface.

    pieces : of the rim, counter-clockwise: lines and arcs at the height `level`, or fitted ones, with None
    """

    pieces: Sequence[RimPiece | FittedPiece]
    level: float | None

    @property
    def rims(self) -> list[Rim]:
        """Knots and poles (x, y, z) of the fitted pieces."""
        return [(piece.kv, piece.poles) for piece in self.pieces if isinstance(piece, FittedPiece)]

    @property
    def heights(self) -> tuple[float, float]:
        """Bounds of z, mm, those of the poles."""
        if self.level is not None:
            return self.level, self.level
        z = np.concatenate([poles[:, 2] for _, poles in self.rims])
        return float(z.min()), float(z.max())

    @property
    def area(self) -> float:
        """The area within, mm^2, of (x dy - y dx) / 2 round it."""
        total = 0.0
        for piece in self.pieces:
            t, weights = piece.rule(np.zeros(0), np.zeros(0), NODES)
            total += float(weights @ cross(np.array(piece(t)), np.array(piece(t, 1)))) / 2
        return total


def knot_lines(surface: FreeformSurface) -> Lines:
    """Return the inner knots of a surface in x and in y, mm, and how often a curve across needs each."""
    if surface.sag is None:
        return Lines(np.empty(0), np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    sag = surface.sag.to_bspline()
    pairs = zip((sag.kv_u, sag.kv_v), surface.half_width)
    rows = [kinks(kv.rescale(-h, h)) for kv, h in pairs]
    axis = np.repeat([0, 1], [len(values) for values, _ in rows])
    level, count = (np.concatenate(row) for row in zip(*rows))
    return Lines(level, count, axis)


def crossings(curve: Points, t: Floats, lines: Lines) -> tuple[Floats, Integers]:
    """Return where a curve (x, y, z) of samples t crosses knot lines, and how often each must be a knot.

    Between two samples the Illinois method finds a crossing: of a smooth curve it squares the error twice in
    three steps.

    Source: M. Dowell, P. Jarratt, BIT 11 (1971) 168.
    """
    beside = curve(t)[:, lines.axis] - lines.level
    sample, line = np.nonzero(beside[:-1] * beside[1:] < 0)
    low, high, at_low, at_high = t[sample], t[sample + 1], beside[sample, line], beside[sample + 1, line]
    place, axis, level = low, lines.axis[line], lines.level[line]
    for _ in range(ILLINOIS if len(line) else 0):
        place = high - at_high * (high - low) / (at_high - at_low)
        at = curve(place)[np.arange(len(line)), axis] - level
        turned = at * at_high < 0
        low, at_low = np.where(turned, high, low), np.where(turned, at_high, at_low / 2)
        high, at_high = place, at
        if not (abs(at) > CROSSED).any():
            break
        at_low = np.where(at_low == at_high, 1.0, at_low)  # both 0: the place is found
    return place, lines.count[line]
