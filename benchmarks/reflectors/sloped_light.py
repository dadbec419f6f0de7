"""Light of an area whose points shine alike, by slopes: a source class of a script's own.

A ray leaves (x, y) along (p, q, 1).  Light is even in dx dy dp dq, which is not Lambertian, or Gaussian in
all four.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import atan, degrees, exp, sqrt

import numpy as np
from scipy.special import erf, erfinv

from optics.scene.sources import LightSource, Rays, SourceCells, concentric
from thbcad.certified import Stack, rectangle_supports
from thbcad.checks import Floats

AXIS = 0.0, 0.0
ALL = 1 << 62  # rays at once
TINY = 1e-30  # of the share within a slope: no 0 / 0 in the middle


@dataclass(frozen=True, eq=False, kw_only=True)
class SlopedArea(LightSource):
    """A square |x|, |y| <= half, or a disk, whose points shine into the disk of slopes |(p, q)| <= reach.

    half : mm.  sigma : of Gaussian light on a square, of places in mm and of slopes; None is even light.
    bundle : the disk of radius `half` shines, every point in one direction alone, whose slopes are in
        proportion to its place: what is left without extent.
    """

    half: float
    reach: float
    round: bool = False
    sigma: tuple[float, float] | None = None
    bundle: bool = False

    @property
    def symmetric(self) -> bool:
        return False  # its rays come without their mirror images

    @property
    def extended(self) -> bool:
        return self.reach > 0 and not self.bundle

    @property
    def cone(self) -> float:
        return degrees(atan(self.reach * sqrt(2)))

    def envelope(self) -> tuple[Stack, float]:
        return Stack(np.array([-self.distance]), rectangle_supports((self.half, self.half))[None]), self.cone

    def without_extent(self) -> SlopedArea:
        return replace(self, bundle=True)

    def cells(
        self,
        counts: Sequence[int],
        aperture: Sequence[float] | None = None,
        centre: Sequence[float] = AXIS,
        direction: Floats | None = None,
    ) -> SourceCells:
        """See `LightSource`; s and t run from -1 to 1, equal areas of equal flux."""
        s, t = (2 * np.arange(n + 1) / n - 1 for n in counts)
        emitted = np.full((counts[0], counts[1]), self.flux / (counts[0] * counts[1]))
        return SourceCells(s, t, emitted, self._bundled, lambda s, t: np.ones_like(s))

    def parts(
        self,
        counts: Sequence[int],
        fresh: np.random.Generator | None = None,
        most: int = ALL,
        aperture: Sequence[float] | None = None,
        centre: Sequence[float] = AXIS,
    ) -> Iterator[Rays]:
        from scipy.stats import qmc

        left = 1 << round(np.log2(counts[0] * counts[1]))
        each = self.flux / left
        engine = qmc.Sobol(4, seed=0 if fresh is None else int(fresh.integers(1, 1 << 31)))
        while left:
            s, t, a, b = 2 * engine.random(min(left, most)).T - 1
            left -= len(s)
            flux = np.full(len(s), each)
            yield (
                self._rays(*self._places(s, t), *self._slopes(a, b), flux)
                if self.extended
                else (self._bundled(s, t, flux))
            )

    def _places(self, s: Floats, t: Floats) -> tuple[Floats, Floats]:
        if self.sigma:
            wide = sqrt(2) * self.sigma[0]
            s, t = (wide / self.half * erfinv(a * erf(self.half / wide)) for a in (s, t))
        elif self.round:
            s, t = concentric(s, t)
        return self.half * s, self.half * t

    def _slopes(self, a: Floats, b: Floats) -> tuple[Floats, Floats]:
        """Return slopes over `reach`, points of the unit disk."""
        c, d = concentric(a, b)
        if self.sigma is None:
            return c, d
        share, sigma = np.maximum(c * c + d * d, TINY), self.sigma[1] / self.reach
        cut = 1 - exp(-1 / (2 * sigma**2))
        stretch = sigma * np.sqrt(-2 * np.log1p(-cut * share) / share)
        return stretch * c, stretch * d

    def _bundled(self, s: Floats, t: Floats, flux: Floats) -> Rays:
        c, d = self._slopes(s, t)
        return self._rays(self.half * c, self.half * d, c, d, flux)

    def _rays(self, x: Floats, y: Floats, c: Floats, d: Floats, flux: Floats) -> Rays:
        p, q = self.reach * c, self.reach * d
        length = np.sqrt(1 + p * p + q * q)
        origin = np.stack([x, y, np.full_like(x, -self.distance)])
        return Rays(origin, np.stack([p, q, np.ones_like(p)]) / length, flux)
