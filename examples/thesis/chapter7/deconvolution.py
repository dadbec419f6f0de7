"""Regularised deconvolution in one dimension, how it breaks, and tests of whether a response can exist.

Source: thesis 7.3-7.7 and Figure 7.4; errata: (7.6) needs the conjugate of G^, and with (7.7) as printed, a
rectangle of half-width alpha, two sources at +-0.25 make one of half-width 0.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from thbcad.checks import Floats

EPSILON = 1e-14
# [-5, 5]; 0.25, 0.2501, 0.5 and 0.51 are whole numbers of steps
HALF_DOMAIN = 5.0
SAMPLES = 100_001


@dataclass(frozen=True, eq=False)
class Case:
    """A rectangle of light, the sources that shall make it, and the response by regularised deconvolution.

    x : (n,), the samples
    target, response : (n,)
    half_width : of the rectangle
    sources : (s,), their positions
    """

    x: Floats
    target: Floats
    response: Floats
    half_width: float
    sources: tuple[float, ...]

    @property
    def negative(self) -> float:
        """The integral of the negative part over that of the absolute value."""
        return float(-self.response[self.response < 0].sum() / np.abs(self.response).sum())

    @property
    def outside(self) -> float:
        """The integral of the absolute value where the target is dark, over that everywhere."""
        size = np.abs(self.response)
        return float(size[self.target == 0].sum() / size.sum())


def deconvolve(target: ArrayLike, transform: NDArray[np.complexfloating], epsilon: float) -> Floats:
    """Return the inverse transform of conj(G^) E^ / (|G^|^2 + epsilon) (7.6), periodic.

    target : (n,), E.  transform : (n // 2 + 1,), G^ at the frequencies of ``scipy.fft.rfft``.  Returns (n,).
    """
    spectrum = (
        transform.conj() * fft.rfft(np.asarray(target, dtype=np.float64)) / (np.abs(transform) ** 2 + epsilon)
    )
    return fft.irfft(spectrum, len(np.asarray(target)))


def points_transform(frequency: ArrayLike, sources: ArrayLike) -> NDArray[np.complex128]:
    """Return G^(k) = sum of exp(-2 pi i k x) over point sources of flux 1 at x."""
    return np.exp(-2j * np.pi * np.outer(np.asarray(frequency), np.asarray(sources, dtype=np.float64))).sum(
        axis=1
    )


def rectangle_case(half_width: float, sources: tuple[float, ...], epsilon: float = EPSILON) -> Case:
    """Return the response for a rectangle of height 1, and 1/2 at its edges, at 100,001 samples of [-5, 5].

    The period is one step longer than the domain, so that no frequency is exactly a zero of the transform of
    two sources at +-1/4: there (7.6) would give 0 in place of the limit of E^ / G^.
    """
    x, step = np.linspace(-HALF_DOMAIN, HALF_DOMAIN, SAMPLES, retstep=True)
    edge = np.abs(x) - half_width
    target = np.where(np.abs(edge) < step / 2, 0.5, edge < 0)
    response = deconvolve(target, points_transform(fft.rfftfreq(SAMPLES, step), sources), epsilon)
    return Case(x, target, response, half_width, sources)


def figure_7_4() -> tuple[Case, Case, Case]:
    """Return the cases of Figure 7.4: a solution; a rectangle 2 % wider; a source 1e-4 further out."""
    return (
        rectangle_case(0.5, (-0.25, 0.25)),
        rectangle_case(0.51, (-0.25, 0.25)),
        rectangle_case(0.5, (-0.25, 0.2501)),
    )


def uncovered_zero(weights: ArrayLike, target: ArrayLike) -> float:
    """Return the greatest |E^| / E^(0) at the zeros of G^.

    It is 0 where all zeros of G^ are zeros of E^, or G^ has none.

    weights : (s,), the sources on a row of pixels
    target : (n,), the pixels of the row

    An integrable response needs 0, since E^ = G^ E_p^.  The zeros are the roots of sum of a_n z^n on the unit
    circle.
    """
    a, g = (np.trim_zeros(np.asarray(values, dtype=np.float64)) for values in (weights, target))
    if len(a) == 0 or len(g) == 0:
        raise ValueError("weights and target must have some flux, got zeros only")
    roots = np.roots(a[::-1])
    # a root of multiplicity q moves by eps^(1 / q): up to four sources that differ this is far below the
    # width taken here
    circle = roots[np.abs(np.abs(roots) - 1) < np.finfo(np.float64).eps ** 0.25]
    values = np.abs(np.exp(1j * np.outer(np.angle(circle), np.arange(len(g)))) @ g)
    return float(values.max() / g.sum()) if len(values) else 0.0


def least_eigenvalue(function: ArrayLike) -> float:
    """Return the least eigenvalue of the matrix with entries Phi(x_j - x_k), over the greatest in size.

    The x_j are a periodic row.  The eigenvalues are the transform of Phi (Bochner): Phi is positive definite
    where the result is not negative.  For Phi = E^ / G^ they are the response itself.

    function : (n,), Phi(0), Phi(1), ..., Phi(-1), with Phi(-x) = conj(Phi(x))
    """
    phi = np.asarray(function)
    if not np.allclose(phi, np.conj(np.roll(phi[::-1], 1))):
        raise ValueError("function must be hermitian, Phi(-x) = conj(Phi(x))")
    eigenvalues = fft.fft(phi).real
    return float(eigenvalues.min() / np.abs(eigenvalues).max())
