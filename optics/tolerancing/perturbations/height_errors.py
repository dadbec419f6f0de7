"""Height errors dh(x, y) of a surface: functions with first derivatives, evaluated where rays meet it.

Random ones have periods in a band, and are the same for the same seed.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, cos, pi, radians, sin

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from optics.base.runtime import UserError
from optics.scene.paths import HeightError
from thbcad.checks import Floats, half_widths, read_only, require_integer, require_number
from thbcad.outlines import Outline

AT_ONCE = 1 << 14  # points: their weights stay in the processor's cache
SPANS_PER_PERIOD = 5  # of the shortest: a cubic spline then holds the field to 1 %
MOST_SPANS = 4096  # in each direction
WIDER = 2.0  # apertures, the period of the random field: opposite rims are independent
LONGEST = 2.0  # apertures: what is longer is no form but a tilt or a change of power


@dataclass(frozen=True)
class Sine:
    """The ripple dh = a sin(2 pi s / period + phase) along s = x cos(direction) + y sin(direction).

    amplitude : a, mm; the peak to valley is 2 a, the rms a / sqrt(2).  period : mm.  direction : degrees.
    phase : radians.

    Raises UserError : a number that is not finite, a period that is not positive.
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

    Raises UserError : a curvature that is not finite.
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

    Raises UserError : a net of another shape or not finite, half-widths that are not positive.
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

    Raises UserError : a factor that is not finite.
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


def shortest_period(half_width: tuple[float, float]) -> float:
    """Return the shortest period, mm, that a random field over a rectangle can have.  half_width : mm."""
    return SPANS_PER_PERIOD * 2 * max(half_width) / MOST_SPANS


def random_field(
    band: tuple[float, float],
    rms: float,
    half_width: tuple[float, float],
    seed: int,
    corners: tuple[float, float] = (0.0, 0.0),
) -> SplineHeight:
    """Return a random height error over a rectangle, of which a surface fills an outline.

    All directions carry the same power, and all octaves of the period within the band: the power per area of
    wave vectors falls with 1 / |k|^2.  The phases are independent.  It is scaled to the rms about its own
    mean, over the middles of spans inside the outline.

    band : shortest and longest period, mm.  rms : mm.  half_width : mm.  seed : of pseudo-random numbers
    (`numpy.random.default_rng`).  corners : mm, of the outline, see `thbcad.outlines.Outline`.

    Raises UserError : bad numbers, a band that is too fine for the rectangle, or too long for it.
    """
    short, long = _band(band, half_width, rms, seed)
    size = [2 * h for h in half_width]
    spans = [ceil(SPANS_PER_PERIOD * s / short) for s in size]
    if max(spans) > MOST_SPANS:
        least = shortest_period(half_width)
        raise UserError(
            f"periods of {short:g} mm are too short for {max(size):g} mm; take at least {least:.2g} mm"
        )
    pitch = [s / n for s, n in zip(size, spans)]
    shape = [fft.next_fast_len(ceil(WIDER * max(s, long) / p) + 3) for s, p in zip(size, pitch)]
    kx, ky = fft.fftfreq(shape[0], pitch[0])[:, None], fft.rfftfreq(shape[1], pitch[1])[None, :]
    k = np.hypot(kx, ky)
    within = (k >= 1 / long) & (k <= 1 / short)
    if not within.any():
        raise UserError(f"no period from {short:g} to {long:g} mm fits this rectangle; take a wider band")
    noise = fft.rfft2(np.random.default_rng(seed).standard_normal(shape))
    # the cubic B-spline's samples 1/6, 2/3, 1/6 weaken a wave by (2 + cos) / 3 in each direction
    weakened = (2 + np.cos(2 * np.pi * kx * pitch[0])) * (2 + np.cos(2 * np.pi * ky * pitch[1])) / 9
    filtered = np.where(within, noise / (np.where(within, k, 1.0) * weakened), 0.0)
    net = fft.irfft2(filtered, shape)[: spans[0] + 3, : spans[1] + 3]
    field = SplineHeight(net, half_width)
    x, y = (h * (2 * np.arange(n) + 1 - n) / n for h, n in zip(field.half_width, spans))
    points = np.meshgrid(x, y, indexing="ij")
    heights = field.jet(points[0].ravel(), points[1].ravel())[0]
    outline = Outline(field.half_width, corners)
    if outline.is_rectangle:
        return SplineHeight((net - net.mean()) * (rms / float(heights.std())), half_width)
    heights = heights[outline.contains(*points).ravel()]
    return SplineHeight((net - heights.mean()) * (rms / float(heights.std())), half_width)


def _band(
    band: tuple[float, float], half_width: tuple[float, float], rms: float, seed: int
) -> tuple[float, float]:
    """Return the shortest and the longest period, checked with all other numbers."""
    try:
        widest = 2 * max(half_widths(half_width))
        short, long = band
        require_number("the shortest period", short, above=0, finite=True)
        require_number("the longest period", long, above=0, finite=True)
        require_number("the rms", rms, least=0, finite=True)
        require_integer("the seed", seed, 0)
    except (TypeError, ValueError) as error:
        raise UserError(f"a random height error's numbers: {error}") from None
    if not short < long <= LONGEST * widest:
        raise UserError(
            f"the band of periods must rise to at most {LONGEST * widest:g} mm, twice the aperture, "
            f"got {short:g} to {long:g} mm"
        )
    return float(short), float(long)
