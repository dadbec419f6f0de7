"""Height errors dh(x, y) of a surface: functions with first derivatives, evaluated where rays meet it."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import UserError
from optics.scene.paths import HeightError
from thbcad.checks import half_widths, read_only, require_number

Floats = NDArray[np.float64]

AT_ONCE = 1 << 14  # points: their weights stay in the processor's cache


@dataclass(frozen=True)
class Sine:
    """The ripple dh = a sin(2 pi s / period + phase) along s = x cos(direction) + y sin(direction).

    amplitude : a, mm; the peak to valley is 2 a, the rms a / sqrt(2).  period : mm.  direction : degrees.
    phase : radians.

    Raises
    ------
    UserError : a number that is not finite, a period that is not positive.
    """

    amplitude: float
    period: float
    direction: float = 0.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        for name in ("amplitude", "direction", "phase"):
            _require(name, getattr(self, name))
        _require("period", self.period, above=0)

    def jet(self, x: Floats, y: Floats) -> Floats:
        """Return dh and its derivatives, see `HeightError`."""
        along = radians(self.direction)
        c, s, rate = cos(along), sin(along), 2 * pi / self.period
        turn = rate * (c * x + s * y) + self.phase
        slope = self.amplitude * rate * np.cos(turn)
        return np.stack([self.amplitude * np.sin(turn), c * slope, s * slope])


@dataclass(frozen=True)
class Power:
    """The change of curvature dh = c (x^2 + y^2) / 2.  curvature : c, 1/mm.

    Raises
    ------
    UserError : a curvature that is not finite.
    """

    curvature: float

    def __post_init__(self) -> None:
        _require("curvature", self.curvature)

    def jet(self, x: Floats, y: Floats) -> Floats:
        """Return dh and its derivatives, see `HeightError`."""
        c = self.curvature
        return np.stack([c / 2 * (x * x + y * y), c * x, c * y])


@dataclass(frozen=True, eq=False)
class SplineHeight:
    """A uniform bicubic B-spline over |x| <= half_width[0], |y| <= half_width[1].

    dh = sum_ij b((x + hx) / dx - i + 3) b((y + hy) / dy - j + 3) net_ij with the cubic B-spline b on the
    knots 0 ... 4, and dx = 2 hx / (nx - 3).  Points beside the rectangle are moved to its rim.

    net : (nx, ny), mm, at least 4 in each direction.  half_width : mm.

    Raises
    ------
    UserError : a net of another shape or not finite, half-widths that are not positive.
    """

    net: Floats
    half_width: tuple[float, float]

    def __post_init__(self) -> None:
        try:
            net, half_width = read_only(self.net), half_widths(self.half_width)
        except (TypeError, ValueError) as error:
            raise UserError(f"a height error's net and half_width must be numbers: {error}") from error
        if net.ndim != 2 or min(net.shape) < 4 or not np.isfinite(net).all():
            raise UserError(
                f"a height error's net must be finite and at least 4 x 4 control points, got {net.shape}"
            )
        object.__setattr__(self, "net", net)
        object.__setattr__(self, "half_width", half_width)

    def jet(self, x: Floats, y: Floats) -> Floats:
        """Return dh and its derivatives, see `HeightError`."""
        out = np.empty((3, len(x)))
        for start in range(0, len(x), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            self._part(x[part], y[part], out[:, part])
        return out

    def _part(self, x: Floats, y: Floats, out: Floats) -> None:
        """Write the jet at some points.  The net is gathered once for the value and both derivatives."""
        (i, b, b_x), (j, c, c_y) = (
            _weights(a, h, n) for a, h, n in zip((x, y), self.half_width, self.net.shape)
        )
        out[:] = 0.0
        flat, first = self.net.ravel(), i * self.net.shape[1] + j
        for k in range(4):
            value, slope = np.zeros(len(x)), np.zeros(len(x))
            for m in range(4):
                net = flat.take(first + (k * self.net.shape[1] + m))
                value += c[m] * net
                slope += c_y[m] * net
            out[0] += b[k] * value
            out[1] += b_x[k] * value
            out[2] += b[k] * slope


@dataclass(frozen=True)
class HeightSum:
    """The sum of other height errors, each times a factor; zero of none.

    parts : (factor, HeightError).

    Raises
    ------
    UserError : a factor that is not finite.
    """

    parts: tuple[tuple[float, HeightError], ...]

    def __post_init__(self) -> None:
        for factor, _ in self.parts:
            _require("factor", factor)

    def jet(self, x: Floats, y: Floats) -> Floats:
        """Return dh and its derivatives, see `HeightError`."""
        out = np.zeros((3, np.size(x)))
        for factor, error in self.parts:
            out += factor * error.jet(x, y)
        return out


def _weights(
    a: Floats, half_width: float, count: int
) -> tuple[NDArray[np.int64], list[Floats], list[Floats]]:
    """Return the first of four control points at positions, and the weights of all four: values, slopes."""
    spans = count - 3
    per_mm = spans / (2 * half_width)
    s = (np.clip(a, -half_width, half_width) + half_width) * per_mm
    first = np.minimum(s.astype(np.int64), spans - 1)
    t = s - first
    r = 1 - t
    tt, rr = t * t, r * r
    values = [rr * r / 6, (4 - 6 * tt + 3 * tt * t) / 6, (4 - 6 * rr + 3 * rr * r) / 6, tt * t / 6]
    k = per_mm / 2
    slopes = [-k * rr, k * t * (3 * t - 4), k * r * (4 - 3 * r), k * tt]
    return first, values, slopes


def _require(name: str, value: float, above: float = -np.inf) -> None:
    try:
        require_number(name, value, above=above, finite=True)
    except ValueError as error:
        raise UserError(f"a height error's {error}") from None
