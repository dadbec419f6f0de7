"""A lens of another program as a Lens: planes, conics and splines in graph form as they are, others fitted.

A spline whose x and y are affine in its parameters but for d has the same poles as a graph z(x, y) with
|dz| <= |grad z| d: that is proven.  It is cut to a rectangle round the axis.  Planes and spheres are proven
too.  Another conic of revolution with its vertex on the axis satisfies

    r^2 = 2 R z - (1 + K) z^2,

two unknowns of a linear least-squares problem; of one face its distance is proven by `conic_deviation`.
Everything else is interpolated on a grid, with twice as many spans until it is met.  These fits are compared
with the faces at other points: that is measured.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from thbcad.cad.foreign.conic_bounds import conic_deviation
from thbcad.cad.foreign.optical_surface import CHAMFERED, ROUND_RIM, OpticalFace, in_frame
from thbcad.cad.foreign.surveyed_faces import axial_heights
from thbcad.cad.foreign.upright_graphs import CENTRED, centred, upright
from thbcad.certified import cell_bounds
from thbcad.checks import EPS, require_number
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.poses import Pose
from thbcad.sags import Conic
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface, interpolate
from thbcad.surfaces import THBSurface

LEAST_SPANS, MOST_SPANS = 8, 100  # along each axis; rays to more than that take minutes
DEGREE = 5
NEARLY_ROUND = 1e-2  # of a rim, relative: the largest ellipse within it is taken
CONIC_POINTS = 9  # along a radius in eight directions
CONIC = 1e-9  # mm; what OCCT's intersections and eleven digits of a file leave of a conic
FLATTEST = 1e-12  # 1/mm: a lesser curvature is a plane's
MEASURED = 17  # points along each axis that a conic is measured at, and per span a quarter of them of a fit


@dataclass(frozen=True, eq=False)
class Refit:
    """A Lens in the frame of the ForeignLens that it was made of.

    lens : Lens.  deviation : (front, rear), mm in z.  how : (front, rear), "plane", "conic", "spline as it
    is" or "fitted spline".  proven : (front, rear), whether the deviation is a bound or measured.
    """

    lens: Lens
    deviation: tuple[float, float]
    how: tuple[str, str]
    proven: tuple[bool, bool]

    def __repr__(self) -> str:
        faces = zip(("front", "rear"), self.how, self.deviation, self.proven)
        parts = [f"{name}: {how}, {d:.2g} mm {'proven' if p else 'measured'}" for name, how, d, p in faces]
        return f"Refit({'; '.join(parts)})"


class _Surface(NamedTuple):
    surface: FreeformSurface
    deviation: float
    how: str
    proven: bool


def refitted(
    frame: Pose, thickness: float, faces: tuple[OpticalFace, OpticalFace], index: float, tolerance: float
) -> Refit:
    """Return the Refit of front and rear in their frame, as `ForeignLens.refit`."""
    require_number("tolerance", tolerance, above=0, finite=True)
    surfaces = []
    for name, face, vertex in zip(("front", "rear"), _outlined(frame, faces), (0.0, thickness)):
        slack = CENTRED if face.outline == "rectangle" else CHAMFERED * float(face.half_width.max())
        if np.abs(face.centre).max() > slack:
            x, y = face.centre
            raise ValueError(
                f"the {name} is centred at x = {x:.6g}, y = {y:.6g} mm of the axis; a Lens has front and "
                "rear on one axis"
            )
        surfaces.append(_surface(frame, face, vertex, tolerance, name))
    (front, rear), deviations, hows, proven = zip(*surfaces)
    return Refit(Lens(front, rear, thickness, index), deviations, hows, proven)


def _outlined(frame: Pose, faces: Sequence[OpticalFace]) -> list[OpticalFace]:
    """Return front and rear over the largest ellipses within their rims, where both are nearly round; a lone
    round one has an outline that a Lens does not know."""
    found = []
    for face in faces:
        rim = np.concatenate([in_frame(frame, one.rim)[:, :2] for one in face.faces])
        outer = np.hypot(*(rim / face.half_width).T)
        if face.outline == "rectangle" or np.abs(outer - 1).max() > NEARLY_ROUND:
            return [f if f.outline == "rectangle" else replace(f, outline="other") for f in faces]
        axes = face.half_width * (1.0 if face.outline == "ellipse" else outer.min())
        if np.ptp(axes) < ROUND_RIM * axes.max():  # a circle
            axes = np.full(2, axes.min())
        found.append(replace(face, outline="ellipse", half_width=axes))
    return found


def _surface(frame: Pose, face: OpticalFace, vertex: float, tolerance: float, name: str) -> _Surface:
    """Return the first surface that meets a face within the tolerance."""
    analytic = {"plane": _plane, "sphere": _sphere}
    best = analytic.get(face.kind, _graph)(frame, face, vertex)
    if best is None or best.deviation > tolerance:
        best = _conic(frame, face, vertex)
    if best is None or best.deviation > tolerance:
        if face.radius is not None and np.hypot(*face.half_width) >= face.radius and face.kind == "sphere":
            raise ValueError(
                f"the {name} is a sphere of radius {face.radius:.6g} mm that ends within the rectangle round "
                "its rim, over which the surfaces of a Lens go on; cut the lens to a smaller diameter"
            )
        if face.outline != "rectangle":
            raise ValueError(
                f"the outline of the {name} is no rectangle, and its surface neither a conic nor a spline in "
                "graph form: a Lens is fitted over rectangles"
            )
        best = _fitted(frame, face, vertex, tolerance)
    if best.deviation > tolerance:
        raise ValueError(
            f"the {name} is met within {best.deviation:.2g} mm by the finest fit that is tried; allow a "
            "greater tolerance"
        )
    own = best.surface
    corners = own.half_width if face.outline == "ellipse" else own.corners
    return best._replace(surface=FreeformSurface(own.half_width, own.conic, own.sag, corners))


def _plane(frame: Pose, face: OpticalFace, vertex: float) -> _Surface:
    """Return a plane through the vertex, with the proven deviation that its tilt makes at the corners."""
    tilt = frame.rotation.T @ face.faces[0].samples[1][0]
    half = (float(face.half_width[0]), float(face.half_width[1]))
    slope = float(np.hypot(*tilt[:2]) / abs(tilt[2]))
    rounding = 64 * EPS * float(np.abs(frame.shift).max() + max(half))
    return _Surface(FreeformSurface(half), slope * float(np.hypot(*half)) + rounding, "plane", True)


def _sphere(frame: Pose, face: OpticalFace, vertex: float) -> _Surface | None:
    """Return a sphere with its vertex on the axis, with the proven deviation that the place of its centre
    makes: with the centre e off the axis and d along it, d + e |grad z|."""
    place, size = face.faces[0].centre, face.radius
    if place is None or size is None:
        return None
    centre = in_frame(frame, place) - (0.0, 0.0, vertex)
    radius = float(np.copysign(size, centre[2]))
    half = (float(face.half_width[0]), float(face.half_width[1]))
    off, along = float(np.hypot(*centre[:2])), abs(float(centre[2]) - radius)
    reach = float(np.hypot(*half)) + off
    if len(face.faces) > 1 or reach >= abs(radius):
        return None
    rounding = 64 * EPS * float(np.abs(frame.shift).max() + abs(radius))
    slope = reach / (radius**2 - reach**2) ** 0.5
    surface = FreeformSurface(half, Conic(radius, 0.0))
    return _Surface(surface, along + off * slope + rounding * (1 + slope), "conic", True)


def _graph(frame: Pose, face: OpticalFace, vertex: float) -> _Surface | None:
    """Return a polynomial spline in one piece as a graph with the same poles, with a proven deviation."""
    spline = face.faces[0].spline
    if len(face.faces) > 1 or not isinstance(spline, BSplineSurface):
        return None
    if min(spline.kv_u.degree, spline.kv_v.degree) < 2:
        return None
    kv_u, kv_v, poles = upright(spline.kv_u, spline.kv_v, in_frame(frame, spline.coefficients))
    corners = np.array([poles[0, 0, :2], poles[-1, -1, :2]])
    if (corners[1] <= corners[0]).any():
        return None
    (x0, y0), (x1, y1) = corners.tolist()
    kv_u, kv_v = kv_u.rescale(x0, x1), kv_v.rescale(y0, y1)
    exact = np.stack(np.meshgrid(kv_u.greville(), kv_v.greville(), indexing="ij"), axis=-1)
    apart = np.linalg.norm(poles[..., :2] - exact, axis=-1).max()
    heights = poles[..., 2] - vertex
    graph = BSplineSurface(kv_u, kv_v, heights)
    slope = np.hypot(*cell_bounds(graph, ((1, 0), (0, 1))).max(axis=(1, 2)))
    cut = centred(graph, face.half_width, face.outline != "other")
    if cut is None:
        return None
    rounding = 64 * EPS * float(np.abs(frame.shift).max() + np.abs(poles).max())
    sag = THBSurface(THBSpace(cut.kv_u, cut.kv_v), cut.coefficients.ravel())
    return _Surface(
        FreeformSurface((cut.kv_u.stop, cut.kv_v.stop), Conic(), sag),
        float(slope * (apart + rounding) + rounding),
        "spline as it is",
        True,
    )


def _conic(frame: Pose, face: OpticalFace, vertex: float) -> _Surface | None:
    """Return the conic of revolution that a face is, or None."""
    angle = np.repeat(np.arange(8) * np.pi / 4, CONIC_POINTS)
    radius = np.tile(np.arange(1, CONIC_POINTS + 1) / CONIC_POINTS, 8) * face.half_width.min() * 0.98
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    z = axial_heights(face.faces, frame, x, y) - vertex
    if not np.isfinite(z).all():
        return None
    curvature = 2 * float(z @ radius**2 / (radius**4).sum())
    if abs(curvature) < FLATTEST:
        conic = Conic()
    else:
        double, squared = np.linalg.lstsq(np.column_stack([z, -(z**2)]), radius**2, rcond=None)[0]
        if not double:
            return None
        conic = Conic(float(double / 2), float(squared - 1))
    half = (float(face.half_width[0]), float(face.half_width[1]))
    try:
        surface = FreeformSurface(half, conic)
    except ValueError:  # it ends within the box of a round lens
        return None
    deviation = _measured(frame, face, vertex, surface, MEASURED)
    if deviation > CONIC:
        return None
    bound = None if conic.is_plane else _conic_bound(frame, face, vertex, conic)
    if bound is not None and bound <= CONIC:
        return _Surface(surface, bound, "conic", True)
    return _Surface(surface, deviation, "plane" if conic.is_plane else "conic", False)


def _conic_bound(frame: Pose, face: OpticalFace, vertex: float, conic: Conic) -> float | None:
    """Return a bound of the distance in z of one face from a conic, None where there is no use of one."""
    spline = face.faces[0].exact_spline
    if len(face.faces) > 1 or spline is None:
        return None
    if isinstance(spline, BSplineSurface):
        spline = NURBSSurface.from_bspline(spline)
    points = in_frame(frame, spline.coefficients) - np.array([0.0, 0.0, vertex])
    bound = conic_deviation(spline.kv_u, spline.kv_v, points, spline.weights, conic)
    if bound is None:
        return None
    reach = float(np.hypot(*points[..., :2].reshape(-1, 2).T).max())
    slope = reach / (conic.radius**2 - (1 + conic.constant) * reach**2) ** 0.5
    return bound + 64 * EPS * float(np.abs(frame.shift).max() + np.abs(points).max()) * (1 + slope)


def _meshes(frame: Pose, face: OpticalFace) -> Iterator[tuple[KnotVector, KnotVector]]:
    """Yield knots in x and y, finer and finer: those of a spline in one piece, where its derivatives jump, or
    uniform ones."""
    spline = face.faces[0].spline
    a, b = face.half_width.tolist()
    if len(face.faces) == 1 and spline is not None and min(spline.kv_u.degree, spline.kv_v.degree) > 1:
        kv_x, kv_y, _ = upright(spline.kv_u, spline.kv_v, in_frame(frame, spline.coefficients))
    else:
        kv_x, kv_y = (KnotVector.uniform(DEGREE, LEAST_SPANS, -h, h) for h in (a, b))
    kv_x, kv_y = kv_x.rescale(-a, a), kv_y.rescale(-b, b)
    yield kv_x, kv_y
    while 2 * max(kv_x.spans, kv_y.spans) <= MOST_SPANS:
        kv_x, kv_y = kv_x.bisect(), kv_y.bisect()
        yield kv_x, kv_y


def _fitted(frame: Pose, face: OpticalFace, vertex: float, tolerance: float) -> _Surface:
    """Return a spline that interpolates a face, with spans until it is met."""
    for kv_x, kv_y in _meshes(frame, face):
        # the outermost a little within the rim, where OCCT finds the face
        x, y = np.meshgrid(*((1 - 1e-9) * kv.greville() for kv in (kv_x, kv_y)), indexing="ij")
        z = axial_heights(face.faces, frame, x.ravel(), y.ravel()) - vertex
        if not np.isfinite(z).all():
            raise ValueError("a line along the axis within the outline misses the optical face")
        graph = interpolate(kv_x, kv_y, z.reshape(x.shape))
        sag = THBSurface(THBSpace(kv_x, kv_y), graph.coefficients.ravel())
        surface = FreeformSurface((kv_x.stop, kv_y.stop), Conic(), sag)
        deviation = _measured(frame, face, vertex, surface, 2 * max(kv_x.spans, kv_y.spans) + MEASURED)
        if deviation <= tolerance:
            break
    return _Surface(surface, deviation, "fitted spline", False)


def _measured(frame: Pose, face: OpticalFace, vertex: float, surface: FreeformSurface, count: int) -> float:
    """Return the greatest distance in z at count x count points; those beside the face do not count."""
    steps = (np.arange(count) + 0.37) / count * 2 - 1  # not where a fit was sampled
    x, y = (a.ravel() for a in np.meshgrid(*(h * steps for h in surface.half_width)))
    z = axial_heights(face.faces, frame, x, y) - vertex
    return float(np.nanmax(np.abs(z - surface(x, y))))
