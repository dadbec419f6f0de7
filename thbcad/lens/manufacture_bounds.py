"""What manufacturing asks of a lens: thicknesses, slopes, radii, heights, features, volume, areas and mass.

All are those of what lies inside the outline.  Extremes come as certified enclosures of the spline graphs of
`Lens.graphs`, which are the surfaces that the CAD files hold: conics other than paraboloids and planes lie
within 1e-11 mm of them.  Slopes and radii are those of the splines too; radii of such a conic differ from the
splines' by up to 1e-4 of them where it is steep.  Volume and areas come by Gauss quadrature.

Concave and convex are meant as seen from the air, where the tool works: a front is concave where z bends
towards -z, a rear where it bends towards +z.
"""

from dataclasses import dataclass, replace

import numpy as np

from thbcad.certified import (
    Enclosure,
    greatest_slope,
    least_radii,
    minimum,
    minimum_on_rim,
    rounding,
    value_range,
)
from thbcad.checks import EPS, Floats, require_number, require_type, shown
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.graph_pieces import segment
from thbcad.lens.lens import Lens
from thbcad.outlines import Outline, integral_inside
from thbcad.sags import gap_graph
from thbcad.splines import UNIT, BSplineSurface

HEIGHT = 1e-8  # tolerance of heights, of the greatest coefficient: 0.2 nm of 20 mm
BENDING = 1e-5  # relative tolerance of slopes and radii: finer than they are measured
LEAST_PART = 1e-3  # of the half-width: the smallest part whose radii are bounded
LEAST_LINES = 33  # each way, between which areas inside an outline are summed
NM_PER_MM = 1e6
MM3_PER_CM3 = 1e3


@dataclass(frozen=True)
class HeightRange:
    """Bounds of max h - min h of a height h(x, y), mm, and both extremes with their positions."""

    least: Enclosure
    greatest: Enclosure

    @property
    def value(self) -> float:
        """The best value, mm."""
        return self.greatest.value - self.least.value

    @property
    def lower(self) -> float:
        """A number that the range is not less than, mm."""
        return max(0.0, float(np.nextafter(self.greatest.lower - self.least.upper, -np.inf)))

    @property
    def upper(self) -> float:
        """A number that the range is not greater than, mm."""
        return float(np.nextafter(self.greatest.upper - self.least.lower, np.inf))


@dataclass(frozen=True)
class Feature:
    """The smallest feature of a sag: degree times knot span, in x and y, on the finest level in use.

    level : int, the finest level that has active functions
    span : (x, y) float, mm, the shortest knot span of the leaf cells on levels that have active functions
    size : (x, y) float, mm, p times the span; the support of one B-spline is one span longer

    Source: thesis 6.3.1 and 6.3.2, last paragraphs.
    """

    level: int
    span: tuple[float, float]
    size: tuple[float, float]

    def wavelengths(self, wavelength: float) -> float:
        """Return the lesser size in wavelengths; wavelength : nm."""
        require_number("wavelength", wavelength, above=0, finite=True)
        return min(self.size) * NM_PER_MM / wavelength


@dataclass(frozen=True)
class SurfaceMetrics:
    """Metrics of one surface; positions are x = u, y = v in mm.

    slope : degrees, greatest angle between surface and plane z = 0
    concave, convex : mm, least radius of curvature as seen from the air, infinite where there is none
    heights : mm, z from the vertex of the conic
    departure : mm, the sag; None without one
    feature : Feature, None without a sag
    area : mm^2.  area_error : mm^2, estimate: the change from one Gauss point fewer
    """

    slope: Enclosure
    concave: Enclosure
    convex: Enclosure
    heights: HeightRange
    departure: HeightRange | None
    feature: Feature | None
    area: float
    area_error: float


@dataclass(frozen=True)
class Manufacturability:
    """Metrics of a lens; thicknesses in mm, in z between points of equal relative position, with the
    position on the rear.

    thickness : the least anywhere.  edge_thickness : the least at the rim.  centre_thickness : at x = y = 0
    greatest_thickness : the greatest anywhere
    volume : mm^3.  density : g/cm^3 or None

    >>> flat = FreeformSurface((5.0, 4.0))
    >>> made = manufacturability(Lens(flat, flat, thickness=2.0, index=1.5), density=1.25)
    >>> round(made.mass, 12), round(made.front.area, 9), made.front.concave.value
    (0.2, 80.0, inf)
    """

    thickness: Enclosure
    centre_thickness: Enclosure
    edge_thickness: Enclosure
    greatest_thickness: Enclosure
    front: SurfaceMetrics
    rear: SurfaceMetrics
    volume: float
    density: float | None

    @property
    def surfaces(self) -> dict[str, SurfaceMetrics]:
        """The surfaces by name, front first."""
        return {"front": self.front, "rear": self.rear}

    @property
    def mass(self) -> float | None:
        """Volume times density, g; None where the density is unknown."""
        return None if self.density is None else mass(self.volume, self.density)


def mass(volume: float, density: float) -> float:
    """Return the mass in g of a volume in mm^3 with a density in g/cm^3."""
    return volume * density / MM3_PER_CM3


def manufacturability(lens: Lens, density: float | None = None) -> Manufacturability:
    """Return the metrics of a lens for its manufacture.

    Bounds of heights differ by 1e-8 of the greatest, those of slopes and radii by 1e-5, or more where a whole
    curve or face holds the extreme.

    density : g/cm^3, None is unknown

    Raises ValueError : no Lens, a sag of degree 1, a density that is not positive and finite.
    """
    require_type("lens", lens, Lens)
    if density is not None:
        require_number("density", density, above=0, finite=True)
    front, rear = lens.graphs()
    gap, outline = gap_graph(front, rear, lens.thickness), lens.rear.outline
    least, most = value_range(gap, tolerance=HEIGHT, outline=outline)
    return Manufacturability(
        thickness=least,
        centre_thickness=_at_centre(gap),
        edge_thickness=_at_rim(gap, outline),
        greatest_thickness=most,
        front=_metrics(lens.front, front, air_above=False),
        rear=_metrics(lens.rear, rear, air_above=True),
        volume=lens.volume(),
        density=density,
    )


def radii_within(lens: Lens, name: str, half_width: tuple[float, float]) -> tuple[Enclosure, Enclosure]:
    """Return the least radii of curvature of the "front" or "rear", concave and convex as seen from the air,
    over the part within half-widths, in mm.

    The part has the shape of the outline.  Half-widths beyond the surface are cut to its own; those below
    1e-3 of its own are raised to this, because rounding errors would hide the bending of a smaller part.

    Raises ValueError : another name; a half-width that is not a finite number of at least 0.
    """
    if name not in ("front", "rear"):
        raise ValueError(f'name must be "front" or "rear", got {shown(name)}')
    for part in half_width:
        require_number("half_width", part, least=0, finite=True)
    surface: FreeformSurface = getattr(lens, name)
    graph = lens.graphs()[name == "rear"]
    hx, hy = (min(max(h, LEAST_PART * all_), all_) for h, all_ in zip(half_width, surface.half_width))
    if (hx, hy) != surface.half_width:
        graph = segment(graph, [hx, hy])
    radii = least_radii(graph, BENDING, surface.outline.scaled((hx, hy)))
    return (radii.concave, radii.convex) if name == "rear" else (radii.convex, radii.concave)


def _metrics(surface: FreeformSurface, graph: BSplineSurface, air_above: bool) -> SurfaceMetrics:
    outline = surface.outline
    radii = least_radii(graph, BENDING, outline)
    concave, convex = (radii.concave, radii.convex) if air_above else (radii.convex, radii.concave)
    departure = None
    if surface.sag is not None:
        sag = surface.sag.to_bspline()
        kv_x, kv_y = (kv.rescale(-h, h) for kv, h in zip((sag.kv_u, sag.kv_v), surface.half_width))
        departures = BSplineSurface(kv_x, kv_y, sag.coefficients)
        departure = HeightRange(*value_range(departures, tolerance=HEIGHT, outline=outline))
    square, error = graph.area() if outline.is_rectangle else _area(graph, outline)
    return SurfaceMetrics(
        slope=_slope_angle(graph, outline),
        concave=concave,
        convex=convex,
        heights=HeightRange(*value_range(graph, tolerance=HEIGHT, outline=outline)),
        departure=departure,
        feature=_feature(surface),
        area=square,
        area_error=error,
    )


def _area(graph: BSplineSurface, outline: Outline) -> tuple[float, float]:
    """Return the area inside an outline by 3 Gauss points each way on pieces of cells; its change from 2."""
    u, v = (
        np.union1d(kv.breaks, np.linspace(kv.start, kv.stop, LEAST_LINES)) for kv in (graph.kv_u, graph.kv_v)
    )
    coarse, fine = (integral_inside(_Stretch(graph), outline, u, v, count) for count in (2, 3))
    return fine, abs(fine - coarse)


@dataclass(frozen=True)
class _Stretch:
    """sqrt(1 + z_x^2 + z_y^2) of a graph: its area by dx dy."""

    graph: BSplineSurface

    def __call__(self, u: Floats, v: Floats) -> Floats:
        return np.sqrt(1 + sum(self.graph(u, v, orders) ** 2 for orders in ((1, 0), (0, 1))))

    def grid(self, u: Floats, v: Floats) -> Floats:
        return np.sqrt(1 + sum(self.graph.grid(u, v, orders) ** 2 for orders in ((1, 0), (0, 1))))


def _slope_angle(graph: BSplineSurface, outline: Outline) -> Enclosure:
    """Return the greatest slope in degrees; the arctangent and the product with 180 / pi round by less than 4
    EPS."""
    steepest = greatest_slope(graph, BENDING, outline)
    ends = steepest.lower, steepest.value, steepest.upper
    lower, value, upper = (float(np.degrees(np.arctan(s))) for s in ends)
    return replace(steepest, lower=lower * (1 - 4 * EPS), value=value, upper=min(upper * (1 + 4 * EPS), 90.0))


def _at_centre(gap: BSplineSurface) -> Enclosure:
    """Return the gap at x = y = 0."""
    a, b = (kv.collocation([0.0]) for kv in (gap.kv_u, gap.kv_v))
    value = float((a @ gap.coefficients @ b.T.toarray()).item())
    error = _mean_error(gap)
    return Enclosure(value - error, value + error, value, 0.0, 0.0)


def _mean_error(gap: BSplineSurface) -> float:
    """Return the error of means of coefficients: 5 roundings per degree of each factor, and the sums."""
    return float(rounding(8 * (gap.kv_u.degree + gap.kv_v.degree + 2), np.abs(gap.coefficients).max()))


def _at_rim(gap: BSplineSurface, outline: Outline) -> Enclosure:
    """Return the least gap on the rim: in the corners that are cut off, and on the sides between them."""
    (hx, hy), (cx, cy) = outline.half_width, outline.corners
    if outline.is_rectangle:
        return _lowest(_on_sides(gap, gap))
    found, error, sides = [minimum_on_rim(gap, outline, HEIGHT)], _mean_error(gap), list[Enclosure]()
    if hx > cx:
        wide = segment(gap, [hx - cx, hy])
        sides += _on_sides(wide, wide)[0::2]
    if hy > cy:
        high = segment(gap, [hx, hy - cy])
        sides += _on_sides(high, high)[1::2]
    return _lowest(found + [replace(s, lower=s.lower - error, upper=s.upper + error) for s in sides])


def _on_sides(wide: BSplineSurface, high: BSplineSurface) -> list[Enclosure]:
    """Return the least gap on two sides along x of one graph and two along y of another; a side is a graph
    that does not vary across."""
    sides = []
    for end, x, y in ((0, high.kv_u.start, wide.kv_v.start), (-1, high.kv_u.stop, wide.kv_v.stop)):
        along_x = minimum(BSplineSurface(wide.kv_u, UNIT, wide.coefficients[:, [end, end]]), tolerance=HEIGHT)
        along_y = minimum(BSplineSurface(UNIT, high.kv_v, high.coefficients[[end, end]]), tolerance=HEIGHT)
        sides += [replace(along_x, v=y), replace(along_y, u=x)]
    return sides


def _lowest(found: list[Enclosure]) -> Enclosure:
    best = min(found, key=lambda each: each.value)
    return replace(best, lower=min(each.lower for each in found), upper=min(each.upper for each in found))


def _feature(surface: FreeformSurface) -> Feature | None:
    if surface.sag is None:
        return None
    space = surface.sag.space
    levels = np.unique(space.functions[:, 0])
    boxes = space.boxes[np.isin(space.cells[:, 0], levels)]
    knots = space.kv_u, space.kv_v
    shortest = (boxes[:, 1::2] - boxes[:, ::2]).min(axis=0)
    x, y = (float(s) * 2 * h / (kv.stop - kv.start) for s, h, kv in zip(shortest, surface.half_width, knots))
    return Feature(int(levels.max()), (x, y), (space.kv_u.degree * x, space.kv_v.degree * y))
