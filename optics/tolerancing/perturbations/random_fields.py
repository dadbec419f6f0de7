"""Random height errors whose periods lie in a band, the same for the same seed."""

from __future__ import annotations

from math import ceil

import numpy as np
from scipy import fft

from optics.base.runtime import UserError
from optics.tolerancing.perturbations.height_errors import SplineHeight
from thbcad.checks import half_widths, require_integer, require_number

SPANS_PER_PERIOD = 5  # of the shortest: a cubic spline then holds the field to 1 %
MOST_SPANS = 4096  # in each direction
WIDER = 2.0  # apertures, the period of the random field: opposite rims are independent
LONGEST = 2.0  # apertures: what is longer is no form but a tilt or a change of power


def shortest_period(half_width: tuple[float, float]) -> float:
    """Return the shortest period, mm, that a random field over a rectangle can have.  half_width : mm."""
    return SPANS_PER_PERIOD * 2 * max(half_width) / MOST_SPANS


def random_field(
    band: tuple[float, float], rms: float, half_width: tuple[float, float], seed: int
) -> SplineHeight:
    """Return a random height error over a rectangle.

    All directions carry the same power, and all octaves of the period within the band: the power per area of
    wave vectors falls with 1 / |k|^2.  The phases are independent.  It is scaled to the rms about its own
    mean, over the rectangle's control points.

    band : shortest and longest period, mm.  rms : mm.  half_width : mm.  seed : of pseudo-random numbers
    (`numpy.random.default_rng`).

    Raises
    ------
    UserError : bad numbers, a band that is too fine for the rectangle, or too long for it.
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
    unscaled = float(field.jet(points[0].ravel(), points[1].ravel())[0].std())
    return SplineHeight((net - net.mean()) * (rms / unscaled), half_width)


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
