"""The made surface, the designed one and a correction that is fitted to what was measured, and how much of
the light crosses where it was measured.

Surface and correction are splines of one THB space.  The correction's space has all cells of one level, as
fine as the points resolve; the made surface's space is refined where either is, and both are carried there by
matrices of refinement, which change neither.

The greatest disc round a place that no point lies in holds

    points in it, at the density of the others > ln n + CONFIDENCE,

in a gap alone: of points at random, a disc as empty as that is there by chance in a file of 400, as counted
for 500 and 2000 points, and of points on a grid in none.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, log, log2, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from optics.tolerancing.machining import LandingResponse
from optics.tolerancing.metrology.alignment import Alignment
from thbcad.checks import Floats
from thbcad.fitting import NoisyFit, Samples, fit_noisy
from thbcad.hierarchy import THBSpace, common_refinement
from thbcad.lens import FreeformSurface
from thbcad.outlines import Outline
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

RAYS = 257  # in each direction, by which the lit surface is known
NEAREST, MEDIAN = 8, 7.67  # the neighbour by which density is told, and the median of points up to it
CONFIDENCE = 8.0
FINE = 64  # points each way, by which the area of a strip is known
STRIP = 1.5  # distances of points: a narrower strip beside them is as near to them as they to each other
POINTS_PER_FUNCTION = 1.5  # finer cells hold no more of what was measured
NEIGHBOURS = 24  # of a point, among which ripple that cells do not hold comes round
MOST_FUNCTIONS = 60_000  # the factors of their matrix take 0.3 GB
BARE_SPANS = 8  # of the first level on a surface without sag
DEGREE = 3


def measured_light(points: Floats, lit: LandingResponse, outline: Outline) -> float:
    """Return the fraction of the light for the target that crosses a surface where it was measured.

    points : x and y, (2, n) mm.  lit : rays that cross the surface.  outline : of it.
    """
    single = np.unique(points.T, axis=0)
    if len(single) <= NEAREST:
        return 0.0
    tree = cKDTree(single)
    apart = tree.query(single, k=NEAREST + 1)[0][:, -1]
    density = MEDIAN / (pi * float(np.median(apart)) ** 2)
    most = log(len(single)) + CONFIDENCE
    known, half_width = np.ones(len(lit.x), bool), outline.half_width
    for axis, at in enumerate((lit.x, lit.y)):  # strips at the rim, however narrow, beside all points
        for sign, end in ((1, single[:, axis].max()), (-1, -single[:, axis].min())):
            strip = half_width[axis] - end
            if strip > STRIP / sqrt(density) and _beyond(outline, axis, end) * density > most:
                known &= sign * at <= end + STRIP / sqrt(density)
    nearest = tree.query(np.stack([lit.x, lit.y], axis=1))[0]
    (x0, x1), (y0, y1) = (
        (np.maximum(at - nearest, -h), np.minimum(at + nearest, h))
        for at, h in zip((lit.x, lit.y), half_width)
    )
    # points in the part of a disc that lies on the surface
    expected = density * pi / 4 * (x1 - x0) * (y1 - y0) * outline.shares((x0, y0), (x1, y1))
    known &= expected <= most
    return float(lit.flux[known].sum() / (lit.flux.sum() or 1.0))


def _beyond(outline: Outline, axis: int, end: float) -> float:
    """Return the area of an outline beyond a line across x (0) or y (1), mm^2."""
    high = np.array(outline.half_width)
    low = -high
    low[axis] = end
    area = 2 * outline.half_width[1 - axis] * (outline.half_width[axis] - end)
    return area * float(outline.shares((low[:1], low[1:]), (high[:1], high[1:]), FINE)[0])


@dataclass(frozen=True, eq=False)
class MadeSurface:
    """A surface as it was made.

    surface : FreeformSurface.  fit : of the correction.  covered : fraction of its cells, those with their
    middle inside the outline, that hold a point.
    unresolved : greatest correlation of the fit's residuals between points and their neighbours; that of
        noise is 0.
    """

    designed: FreeformSurface
    surface: FreeformSurface
    fit: NoisyFit
    covered: float
    unresolved: float

    def correction(self, x: Floats, y: Floats) -> Floats:
        """Return made - designed at points, mm."""
        return self.surface(x, y) - self.designed(x, y)

    def with_noise(self, noise: Floats, factor: float = 1.0) -> FreeformSurface:
        """Return the surface that other noise, (n,) mm, would make of this one: the fit is linear."""
        fitted, more = self.fit.surface, self.fit.carried(factor * noise)
        return _made(self.designed, THBSurface(fitted.space, fitted.coefficients + more))


def made_surface(
    designed: FreeformSurface, aligned: Alignment, smoothing: float | None = None
) -> MadeSurface:
    """Return the made surface from the height errors of aligned points.

    smoothing : of the fit, see `fit_noisy`; None is as much as the noise asks for.
    """
    x, y, _ = aligned.points
    if designed.sag is not None:
        base = THBSpace(designed.sag.space.kv_u, designed.sag.space.kv_v)
    else:
        base = THBSpace(*(KnotVector.uniform(DEGREE, BARE_SPANS, -h, h) for h in designed.half_width))
    # the space with all cells refined as far as the points resolve
    wanted = min(len(x) / POINTS_PER_FUNCTION, MOST_FUNCTIONS)
    space = base.uniform(max(0, floor(log2(sqrt(wanted / (base.kv_u.spans * base.kv_v.spans))))))
    whole = designed if designed.sag is not None else designed.with_sag(THBSurface(base, np.zeros(base.dim)))
    u, v = whole.to_parameters(x, y)
    fit = fit_noisy(space, Samples(u, v, aligned.heights), smoothing)
    held = np.zeros(len(space.cells), bool)
    held[space.locate(u, v)] = True
    inside = _inside(designed, space)
    # the mean product of each residual with that of its first, second ... neighbour, over the mean square
    at, r = np.stack([x, y], axis=1), fit.residuals
    others = cKDTree(at).query(at, k=min(NEIGHBOURS + 1, len(x)))[1][:, 1:]
    likeness = max((np.mean(r * r[other]) for other in others.T), default=0.0) / (np.mean(r**2) or 1.0)
    return MadeSurface(
        designed=designed,
        surface=_made(designed, fit.surface),
        fit=fit,
        covered=float((held & inside).sum() / inside.sum()),
        unresolved=float(likeness),
    )


def _inside(designed: FreeformSurface, space: THBSpace) -> NDArray[np.bool_]:
    """Return which cells have their middle inside the outline of a surface."""
    middles = (space.boxes[:, ::2] + space.boxes[:, 1::2]).T / 2
    ends = [(kv.start, kv.stop) for kv in (space.kv_u, space.kv_v)]
    x, y = (h * (2 * m - a - b) / (b - a) for h, m, (a, b) in zip(designed.half_width, middles, ends))
    return designed.outline.contains(x, y)


def _made(designed: FreeformSurface, correction: THBSurface) -> FreeformSurface:
    """Return designed + correction on the space that is refined where either is."""
    if designed.sag is None:
        return designed.with_sag(correction)
    own = designed.sag.space
    common = common_refinement(own, correction.space)
    sag = own.prolongation(common) @ designed.sag.coefficients
    added = correction.space.prolongation(common) @ correction.coefficients
    return designed.with_sag(THBSurface(common, sag + added))
