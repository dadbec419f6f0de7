"""What etendue forbids every lens of a problem, whatever its six faces do: the universal bound.

No passive optics makes light brighter.  At a point x of the target light of radiance L at most comes from
within the silhouette of the lens's envelope, so that 0 <= E(x) <= L P(x), and a pixel gets L times the mean
of P at most (`etendue.silhouette`).  That holds for light by all paths through the solid, and for all
solids in the envelope.  Source and target are in air.  With the efficiency eta, the fraction of the source's
flux Phi on the pixels of the target, their sum is known too.  The light beside the target is free.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.designing.etendue.silhouette import pixel_etendue
from optics.designing.etendue.throughput_bound import radiance
from optics.scene.system import System
from thbcad.checks import EPS, Floats

CURVE = tuple(k / 10 for k in range(1, 11))  # efficiencies
ROUNDING = 64 * EPS  # of sums over pixels by pairs, relative; numpy errs by a few EPS


@dataclass(frozen=True, eq=False)
class UniversalBound:
    """Bounds for all lenses of a problem.

    most : (rows, columns), W, greatest flux of every pixel
    picture : (rows, columns), the target scaled to mean 1; in the far field intensities
    area : (rows, columns), mm^2 of a pixel; in the far field square degrees of solid angle
    flux : W, of the source
    """

    most: Floats
    picture: Floats
    area: Floats
    flux: float

    def least_rel_l2(self, efficiency: float) -> float | None:
        """Return the least rel_l2 of light that brings this fraction of the flux, or more, to the target.

        It grows with the efficiency.  None where no light has it.

        In the far field the mean of the intensity I is not known from the flux, but for
        mean I >= eta Phi / (n max area); that bounds I / mean I.
        """
        needed = efficiency * self.flux
        if needed > self.most_on_target * (1 + ROUNDING):
            return None
        mean = needed / (self.picture.size * float(self.area.max()))
        return least_distance(self.picture, self.most / self.area / mean)

    @cached_property
    def most_on_target(self) -> float:
        """W on the pixels of the target, at most."""
        return min(self.flux, float(self.most.sum()))

    @cached_property
    def most_on_lit(self) -> float:
        """W on the pixels where light is asked for, at most."""
        return min(self.flux, float(self.most[self.picture > 0].sum()))

    @cached_property
    def peak(self) -> float:
        """The highest irradiance of a pixel, W/mm^2; in the far field intensity, W per square degree."""
        return min(float((self.most / self.area).max()), self.flux / float(self.area.min()))

    @cached_property
    def exact_efficiency(self) -> float:
        """The greatest efficiency at which the picture itself is not forbidden."""
        wanted = self.picture * self.area
        lit = wanted > 0
        return min(1.0, float((self.most[lit] / wanted[lit]).min()) * float(wanted.sum()) / self.flux)

    def curve(self) -> list[tuple[float, float | None]]:
        """Return (efficiency, least rel_l2) for the efficiencies of CURVE."""
        return [(efficiency, self.least_rel_l2(efficiency)) for efficiency in CURVE]


def universal_bound(system: System) -> UniversalBound:
    """Return the UniversalBound of a problem with a Lambertian source and a known z_freedom."""
    screen = system.target.screen()
    projection = screen.projection()
    picture = system.target.irradiance(screen, 1.0) / projection
    return UniversalBound(
        most=radiance(system) * pixel_etendue(system),
        picture=picture / picture.mean(),
        area=projection * screen.pixel_area,
        flux=system.problem.flux,
    )


def least_distance(goal: Floats, most: Floats) -> float | None:
    """Return a lower bound of ||e - g|| / ||g|| over 0 <= e <= c with mean e = mean g, None if there is no e.

    The problem is convex: the projection of g on a capped simplex.  With a multiplier s of the mean the
    conditions of Karush, Kuhn and Tucker are

        e - g + s <= 0 where e = c,    = 0 where 0 < e < c,    >= 0 where e = 0.

    Caps c < g take light away, which the others get: s <= 0, and no pixel below its cap becomes darker.  So

        e = min(c, g - s) >= 0

    meets all conditions and is the least.  sum e falls with s and is linear between the points g - c.  By
    weak duality every s bounds the least from below,

        ||e - g||^2 + 2 s (sum e - sum g) <= least ||e - g||^2,    e as above.

    So an inexact s costs sharpness only.  Rounding, ROUNDING of every sum, is subtracted.

    goal, most : g >= 0, g > 0 somewhere, and c >= 0, of one shape

    Source: S. Boyd and L. Vandenberghe, Convex Optimization, 5.1 and 5.5.
    """
    g, c = goal.ravel(), np.minimum(most.ravel(), goal.sum())
    total = float(g.sum())
    if float(c.sum()) < total * (1 - ROUNDING):
        return None
    if (g <= c).all():
        return 0.0
    s = _multiplier(g, c, total)
    e = np.minimum(c, g - s)
    terms = float(np.square(e - g).sum()), 2 * s * float(e.sum()), 2 * s * total
    bound = terms[0] + terms[1] - terms[2] - ROUNDING * sum(map(abs, terms))
    return float(np.sqrt(max(0.0, bound) / np.square(g).sum()) * (1 - ROUNDING))


def _multiplier(g: Floats, c: Floats, total: float) -> float:
    """Return the s <= 0 with sum min(c, g - s) = total, where c < g somewhere."""
    points = np.unique(np.minimum(g - c, 0.0))
    inner = range(1, len(points) - 1)
    low = bisect_left(inner, True, key=lambda k: bool(np.minimum(c, g - points[k]).sum() <= total))
    a, b = points[low], points[min(low + 1, len(points) - 1)]
    over, under = (float(np.minimum(c, g - s).sum()) for s in (a, b))
    return float(a + (b - a) * (over - total) / (over - under)) if over > under else float(b)
