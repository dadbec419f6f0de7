"""Exact impulse responses of equal, equidistant sources that make a rectangle of light.

With N sources `spacing` apart, (7.14) becomes G^(k) = sin(pi N k spacing) / (N sin(pi k spacing)) about their
middle, in the convention of (7.4) and with flux 1.  A rectangle of full width L has the transform sin(pi k L)
/ (pi k).  M times sin(2 t) = 2 sin t cos t leaves

    sin(pi k L) / (pi k) = sin(pi k L / 2^M) / (pi k) * product over m = 1..M of 2 cos(pi k L / 2^m),

and spacing = L / (2^M N) makes sin(pi N k spacing) the first factor, so that

    E_p^(k) = N sin(pi k spacing) / (pi k) * product over m of 2 cos(pi k L / 2^m):

2^M rectangles of width `spacing` and height N, L / 2^M apart.  Every zero of G^ is one of the rectangle's
transform.

Source: thesis 7.9-7.23; errata: (7.13) has N terms, the spacing is 1 / (2^M N a), (7.22) lacks a and (7.23)
lacks N.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from optics.designing.etendue import Kernel
from thbcad.checks import Floats, require_integer, require_number


@dataclass(frozen=True)
class RectangleResponse:
    """The response with which N equal sources make a rectangle of height 1 about 0.

    width : L, the full width of the rectangle
    sources : N >= 1
    splits : M >= 0, how often the argument of the sine is halved

    Raises ValueError : a width that is not positive, no source, negative splits.
    """

    width: float
    sources: int
    splits: int = 0

    def __post_init__(self) -> None:
        require_number("width", self.width, above=0.0)
        require_integer("sources", self.sources, 1)
        require_integer("splits", self.splits, 0)

    @property
    def spacing(self) -> float:
        """The distance between sources and the width of a piece of the response, L / (2^M N)."""
        return self.width / (2**self.splits * self.sources)

    @property
    def positions(self) -> Floats:
        """The positions of the sources, about 0, (N,)."""
        return self.spacing * (np.arange(self.sources, dtype=np.float64) - (self.sources - 1) / 2)

    @property
    def centres(self) -> Floats:
        """The middles of the pieces, about 0, (2^M,)."""
        count = 2**self.splits
        return self.width / count * (np.arange(count, dtype=np.float64) - (count - 1) / 2)

    def __call__(self, x: ArrayLike) -> Floats:
        """Return E_p(x): N on the pieces, 0 elsewhere."""
        offset = np.abs(np.asarray(x, dtype=np.float64)[..., None] - self.centres)
        return np.where((offset <= self.spacing / 2).any(axis=-1), float(self.sources), 0.0)

    def transform(self, frequency: ArrayLike) -> Floats:
        """Return E_p^(k) in the convention of (7.4)."""
        k = np.asarray(frequency, dtype=np.float64)
        cosines = [2 * np.cos(np.pi * k * self.width / 2**m) for m in range(1, self.splits + 1)]
        return self.sources * self.spacing * np.sinc(k * self.spacing) * np.prod(cosines, axis=0)

    def on_pixels(self, pixels: int) -> tuple[Kernel, Floats]:
        """Return the kernel, (1, k), and the light, (1, n), exactly, with one piece `pixels` wide.

        The convolution of both is `width / spacing * pixels` ones.  An even distance between the outer
        sources is needed for a kernel about its middle; other distances get one tap without light.
        """
        taps = np.zeros(((self.sources - 1) * pixels + 1,))
        taps[::pixels] = 1
        piece = np.repeat([self.sources, 0], [pixels, (self.sources - 1) * pixels])
        light = np.tile(piece, 2**self.splits)[: len(piece) * 2**self.splits - (self.sources - 1) * pixels]
        return Kernel.image(taps[None]), light[None].astype(np.float64)


def source_transform(frequency: ArrayLike, sources: int, spacing: float) -> Floats:
    """Return G^(k) = sin(pi N k s) / (N sin(pi k s)) (7.14).

    It is the transform of N equal sources of flux 1 / N, s apart, about their middle.
    """
    turn = 2 * np.pi * spacing * np.asarray(frequency, dtype=np.float64)[..., None]
    return np.cos(turn * (np.arange(sources) - (sources - 1) / 2)).mean(axis=-1)
