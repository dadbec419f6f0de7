"""A spline over a conic that meets an optical surface: the sag of one that is neither conic nor graph.

The surface is interpolated at the Greville points of a rectangle, with twice as many spans until it is met.
An outline that is no rectangle leaves points of that grid without glass.  There the surface is continued
along the ray from the middle: at the gauge 1 + t it takes the value of the polynomial through the points at
the gauges 1 - lambda_k t.  As many derivatives as these points go on across the rim, so that the spline
converges as it would without a rim.

A surface of revolution around the axis needs its meridian alone, which `meridian_heights` evaluates: OCCT's
lines miss such faces near their rims.

Source: M. R. Hestenes, Extension of the range of a differentiable function, Duke Math. J. 8 (1941).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import make_interp_spline

from thbcad.cad.foreign.face_groups import axial_heights, meridian_heights
from thbcad.cad.foreign.optical_surface import OpticalFace, in_frame
from thbcad.cad.foreign.upright_graphs import upright
from thbcad.checks import Floats
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.outlines import Outline
from thbcad.poses import Pose
from thbcad.sags import Conic
from thbcad.splines import KnotVector, interpolate
from thbcad.surfaces import THBSurface

LEAST_SPANS, MOST_SPANS = 8, 100  # along each axis; rays to more than that take minutes
DEGREE = 5
WITHIN = 1 - 1e-9  # of a gauge: on the rim OCCT may find no face
LAMBDA = 1 - np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))  # between 0 and 2: Chebyshev's
RAYS, RADII = 8, 9  # at which a surface is sampled for a conic, and asked whether it is one of revolution
REVOLVED = 0.1  # of the tolerance: how far heights at one radius may differ on a surface of revolution
MERIDIAN = 257  # points of a meridian, denser near its rim
MERIDIAN_DEGREE = 7
TIP = 1e-6  # of the reach: a conic of a lesser radius is a cone
FLATTEST = 1e-12  # 1/mm: a lesser curvature is a plane's
MEASURED = 17  # points along each axis at which a surface is compared, and two more for each span of a fit
Heights = Callable[[Floats, Floats], Floats]


@dataclass(frozen=True, eq=False)
class GlassHeights:
    """z(x, y) of an optical surface within an outline, less that of its vertex; NaN without glass, mm."""

    frame: Pose
    face: OpticalFace
    vertex: float
    outline: Outline

    def __call__(self, x: Floats, y: Floats) -> Floats:
        if self.is_revolved:
            return meridian_heights(self.face.faces, self.frame, np.hypot(x, y)) - self.vertex
        return axial_heights(self.face.faces, self.frame, x, y) - self.vertex

    @cached_property
    def is_revolved(self) -> bool:
        """Whether it is a surface of revolution around the axis, by its kind, within a circle."""
        return self.outline.is_circle and self.face.is_revolved_around(self.frame)

    def polar_samples(self) -> tuple[Floats, Floats, Floats]:
        """Return x, y and z on circles, or ellipses, within the outline, (RAYS, RADII) each."""
        angle = np.arange(RAYS)[:, None] * (2 * np.pi / RAYS)
        radius = np.arange(1, RADII + 1) / RADII * min(self.outline.half_width) * 0.98
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        if self.is_revolved:
            return x, y, np.tile(self(radius, 0 * radius), (RAYS, 1))
        return x, y, self(x.ravel(), y.ravel()).reshape(x.shape)

    def greatest_distance(self, surface: FreeformSurface, count: int) -> float:
        """Return the greatest distance in z from a surface at count x count points; those without glass or
        beside the outline do not count.

        Of a surface of revolution, at twice as many points of one meridian, turned to `count` directions.
        """
        steps = (np.arange(count) + 0.37) / count * 2 - 1  # not where a fit was sampled
        if self.is_revolved:
            radius = (np.arange(2 * count) + 0.37) / (2 * count) * self.outline.half_width[0]
            turn = np.pi * steps[:, None]
            z = self(radius, 0 * radius)
            made = surface(radius * np.cos(turn), radius * np.sin(turn))
            return float(np.nanmax(np.abs(z - made)))
        x, y = (a.ravel() for a in np.meshgrid(*(h * steps for h in surface.half_width)))
        inside = self.outline.contains(x, y)
        return float(np.nanmax(np.abs(self(x[inside], y[inside]) - surface(x[inside], y[inside]))))


def conic_of(x: Floats, y: Floats, z: Floats) -> Conic | None:
    """Return the conic with its vertex at 0 that is nearest to points, None of a cone: by least squares of

    r^2 = 2 R z - (1 + K) z^2.
    """
    radius_squared = x * x + y * y
    curvature = 2 * float((z * radius_squared).sum() / (radius_squared**2).sum())
    if abs(curvature) < FLATTEST:
        return Conic()
    columns = np.column_stack([z.ravel(), -(z**2).ravel()])
    double, squared = np.linalg.lstsq(columns, radius_squared.ravel(), rcond=None)[0]
    sharp = abs(double) / 2 < TIP * float(radius_squared.max()) ** 0.5
    return None if sharp else Conic(float(double / 2), float(squared - 1))


def fitted_surface(glass: GlassHeights, tolerance: float) -> tuple[FreeformSurface, float]:
    """Return a conic with a spline sag that meets a surface, and the greatest distance that was measured.

    Raises ValueError : a line along the axis within the outline misses the surface; a cone.
    """
    x, y, z = glass.polar_samples()
    require_glass(z)
    half = glass.outline.half_width
    revolved = glass.outline.is_circle and np.ptp(z, axis=0).max() <= REVOLVED * tolerance
    base = _base(conic_of(x, y, z), half) if revolved else Conic()
    heights = _by_meridian(glass) if revolved else glass
    for kv_x, kv_y in _meshes(glass):
        x, y = np.meshgrid(*(WITHIN * kv.greville() for kv in (kv_x, kv_y)), indexing="ij")
        rest = _continued(lambda a, b: heights(a, b) - base(a, b), glass.outline, x.ravel(), y.ravel())
        require_glass(rest)
        graph = interpolate(kv_x, kv_y, rest.reshape(x.shape))
        sag = THBSurface(THBSpace(kv_x, kv_y), graph.coefficients.ravel())
        surface = FreeformSurface(half, base, sag)
        deviation = glass.greatest_distance(surface, MEASURED)
        if deviation <= tolerance:
            deviation = glass.greatest_distance(surface, 2 * max(kv_x.spans, kv_y.spans) + MEASURED)
        if deviation <= tolerance:
            break
    return surface, deviation


def require_glass(heights: Floats) -> None:
    """Raise ValueError where a height was not found."""
    if not np.isfinite(heights).all():
        raise ValueError("a line along the axis within the outline misses the optical face")


def _base(conic: Conic | None, half_width: tuple[float, float]) -> Conic:
    """Return a conic over the whole rectangle: the one given, else a paraboloid with its radius."""
    if conic is None:
        raise ValueError(
            "an optical face is a cone with its tip on the axis; the surfaces of a Lens are smooth"
        )
    try:
        conic.require(half_width)
    except ValueError:
        return Conic(conic.radius, -1.0)
    return conic


def _by_meridian(glass: GlassHeights) -> Heights:
    """Return the heights of a surface that is one of revolution, by a spline through points of one ray and
    their mirror images at the axis."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, MERIDIAN)
    radius = WITHIN * glass.outline.half_width[0] * np.sin(turn)
    half = radius[MERIDIAN // 2 :]
    z = glass(half, 0 * half)
    require_glass(z)
    spline = make_interp_spline(radius, np.concatenate([z[:0:-1], z]), MERIDIAN_DEGREE)
    return lambda x, y: np.asarray(spline(np.hypot(x, y)))


def _continued(heights: Heights, outline: Outline, x: Floats, y: Floats) -> Floats:
    """Return heights at points, (n,), those beside the outline continued from within."""
    gauge = outline.gauge(x, y)
    inside = gauge <= 1
    z = np.empty(len(x))
    z[inside] = heights(x[inside], y[inside])
    beyond, x, y = gauge[~inside] - 1, x[~inside], y[~inside]
    total = np.zeros(len(x))
    for k, step in enumerate(LAMBDA):
        others = np.delete(LAMBDA, k)
        share = float(np.prod((1 + others) / (others - step)))  # of Lagrange, from -lambda_k to 1
        scale = (1 - step * beyond) / (1 + beyond)
        total += share * heights(scale * x, scale * y)
    z[~inside] = total
    return z


def _meshes(glass: GlassHeights) -> Iterator[tuple[KnotVector, KnotVector]]:
    """Yield knots in x and y, finer and finer: those of a spline in one piece over a rectangle, where its
    derivatives jump, or uniform ones."""
    face = glass.face
    spline = face.faces[0].spline
    a, b = glass.outline.half_width
    whole = len(face.faces) == 1 and glass.outline.is_rectangle
    if whole and spline is not None and min(spline.kv_u.degree, spline.kv_v.degree) > 1:
        kv_x, kv_y, _ = upright(spline.kv_u, spline.kv_v, in_frame(glass.frame, spline.coefficients))
    else:
        kv_x, kv_y = (KnotVector.uniform(DEGREE, LEAST_SPANS, -h, h) for h in (a, b))
    kv_x, kv_y = kv_x.rescale(-a, a), kv_y.rescale(-b, b)
    yield kv_x, kv_y
    while 2 * max(kv_x.spans, kv_y.spans) <= MOST_SPANS:
        kv_x, kv_y = kv_x.bisect(), kv_y.bisect()
        yield kv_x, kv_y
