"""A lens of another program as a Lens: planes, conics and splines in graph form as they are, others fitted.

Planes, spheres and splines in graph form (`spline_graph`) are proven.  Another conic of revolution with its
vertex on the axis is found by least squares; of one face its distance is proven by `conic_deviation`.
Everything else is fitted (`fitted_surface`) and compared with the faces at other points: that is measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from OCP.TopoDS import TopoDS_Shape

from thbcad.cad.exchange import solid_volume
from thbcad.cad.foreign.conic_bounds import conic_deviation
from thbcad.cad.foreign.face_groups import INTEGRAL
from thbcad.cad.foreign.glass_checks import VOLUME, cut_by_walls, require_same_glass, require_whole
from thbcad.cad.foreign.optical_surface import CHAMFERED, OpticalFace, in_frame, is_one_surface
from thbcad.cad.foreign.spline_graphs import spline_graph
from thbcad.cad.foreign.surface_fits import MEASURED, GlassHeights, conic_of, fitted_surface
from thbcad.cad.foreign.surveyed_faces import surveyed
from thbcad.cad.foreign.upright_graphs import CENTRED, centred
from thbcad.checks import EPS
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.outlines import Outline
from thbcad.poses import Pose
from thbcad.sags import Conic
from thbcad.splines import BSplineSurface, NURBSSurface
from thbcad.surfaces import THBSurface

CONIC = 1e-9  # mm; what OCCT's intersections and eleven digits of a file leave of a conic
CORNERS = 1e-6  # relative: corners of front and rear that differ by less are one
A_LENS_HAS = "a Lens has the outline of a rectangle, with round corners or not, or of an ellipse"


@dataclass(frozen=True, eq=False)
class Refit:
    """A Lens in the frame of the ForeignLens that it was made of.

    lens : Lens.  deviation : (front, rear), mm in z.  how : (front, rear), "plane", "conic", "spline as it
    is" or "fitted spline".  proven : (front, rear), whether the deviation is a bound or measured.
    volume, solid_volume : mm^3, of the lens and of the solid.  They differ by what lies outside the outline
    of front and rear, such as chamfers and flanges: within the outline they are compared.
    """

    lens: Lens
    deviation: tuple[float, float]
    how: tuple[str, str]
    proven: tuple[bool, bool]
    volume: float
    solid_volume: float

    def __repr__(self) -> str:
        faces = zip(("front", "rear"), self.how, self.deviation, self.proven)
        parts = [f"{name}: {how}, {d:.2g} mm {'proven' if p else 'measured'}" for name, how, d, p in faces]
        return f"Refit({'; '.join([*parts, *self._outside()])})"

    def __str__(self) -> str:
        """Return a sentence that says how each face is described, and how well."""
        faces = zip(("front", "rear"), self.how, self.deviation, self.proven)
        parts = [
            f"the {name} is a {how}, which the file's face meets within {d:.2g} mm "
            f"({'proven' if p else 'measured'})"
            for name, how, d, p in faces
        ]
        return "; ".join([*parts, *self._outside()])

    def _outside(self) -> list[str]:
        """Return what lies outside the outline, in words; [] where nothing does."""
        apart = self.solid_volume - self.volume
        if abs(apart) <= VOLUME * self.solid_volume:
            return []
        return [f"{apart:.6g} mm^3 of the solid's {self.solid_volume:.6g} mm^3 lie outside the outline"]


class _Surface(NamedTuple):
    surface: FreeformSurface
    deviation: float
    how: str
    proven: bool


def refitted(
    frame: Pose,
    thickness: float,
    faces: tuple[OpticalFace, OpticalFace],
    solid: TopoDS_Shape,
    index: float,
    tolerance: float,
) -> Refit:
    """Return the Refit of front and rear of a solid in their frame, as `ForeignLens.refit`."""
    require_whole(faces)
    outlines, own, walls = _outlines(faces), solid_volume(solid, INTEGRAL), surveyed(solid)
    fits = _surfaces(frame, thickness, faces, outlines, tolerance)
    lens = Lens(fits[0].surface, fits[1].surface, thickness, index)
    volume = lens.volume()
    apart = volume / own - 1
    if apart > VOLUME or (apart < -VOLUME and cut_by_walls(frame, walls, faces, lens)):  # by a flange
        fits = _surfaces(frame, thickness, faces, _smaller(outlines), tolerance)
        lens = Lens(fits[0].surface, fits[1].surface, thickness, index)
        volume = lens.volume()
    require_same_glass(frame, walls, faces, lens, (volume, own))
    _, deviations, hows, proven = zip(*fits)
    return Refit(lens, deviations, hows, proven, volume, own)


def _surfaces(
    frame: Pose,
    thickness: float,
    faces: Sequence[OpticalFace],
    outlines: Sequence[Outline],
    tolerance: float,
) -> list[_Surface]:
    """Return the surfaces of front and rear within their outlines."""
    surfaces = []
    for name, face, outline, vertex in zip(("front", "rear"), faces, outlines, (0.0, thickness)):
        slack = CENTRED if face.outline == "rectangle" else CHAMFERED * float(face.half_width.max())
        if np.abs(face.centre).max() > slack:
            x, y = face.centre
            raise ValueError(
                f"the {name} is centred at x = {x:.6g}, y = {y:.6g} mm of the axis; a Lens has front and "
                "rear on one axis"
            )
        surfaces.append(_surface(GlassHeights(frame, face, vertex, outline), tolerance, name))
    return surfaces


def _smaller(outlines: Sequence[Outline]) -> list[Outline]:
    """Return the largest outline of the same proportions of corners that lies within both, twice."""
    a, b = np.min([outline.half_width for outline in outlines], axis=0).tolist()
    share_x, share_y = outlines[0].relative_corners
    return [Outline((a, b), (share_x * a, share_y * b))] * 2


def _outlines(faces: Sequence[OpticalFace]) -> list[Outline]:
    """Return the outlines of front and rear, where a Lens has such ones."""
    for name, face in zip(("front", "rear"), faces):
        rim, (a, b) = face.rim, 2 * face.half_width
        if rim.word == "other" and not rim.is_nearly_round:
            x, y = np.array(rim.at) + face.centre
            raise ValueError(
                f"the outline of the {name}, {a:.6g} x {b:.6g} mm and {rim.area:.6g} mm^2, is another: it is "
                f"{rim.apart:.3g} mm off the nearest of those, {rim.nearest.text()}, at x = {x:.6g}, y = "
                f"{y:.6g} mm; {A_LENS_HAS}"
            )
    front, rear = (face.rim.within for face in faces)
    corners, own = front.relative_corners, rear.relative_corners
    if np.abs(np.subtract(corners, own)).max() > CORNERS:
        raise ValueError(
            f"the outlines of front and rear differ: {front.text()} and {rear.text()}; a Lens has one, which "
            "may be larger on one side"
        )
    return [
        front,
        Outline(rear.half_width, (corners[0] * rear.half_width[0], corners[1] * rear.half_width[1])),
    ]


def _surface(glass: GlassHeights, tolerance: float, name: str) -> _Surface:
    """Return the first surface that meets a face within the tolerance."""
    analytic = {"plane": _plane, "sphere": _sphere}
    best = analytic.get(glass.face.kind, _graph)(glass)
    if best is None or best.deviation > tolerance:
        best = _conic(glass)
    if best is None or best.deviation > tolerance:
        best = _Surface(*fitted_surface(glass, tolerance), "fitted spline", False)
    if best.deviation > tolerance:
        face, reach = glass.face, float(np.hypot(*glass.outline.half_width))
        ends = face.kind == "sphere" and face.radius is not None and reach >= face.radius
        why = " that ends within the rectangle round its rim, over which a Lens goes on" * ends
        remedy = "allow a greater tolerance" + ", or cut the lens to a smaller size" * ends
        raise ValueError(
            f"the {name} is a {face.described()}{why}: the finest fit that is tried meets it within "
            f"{best.deviation:.2g} mm; {remedy}"
        )
    own, outline = best.surface, glass.outline
    (share_x, share_y), (a, b) = outline.relative_corners, own.half_width
    corners = share_x * a, share_y * b
    return best._replace(surface=FreeformSurface(own.half_width, own.conic, own.sag, corners))


def _plane(glass: GlassHeights) -> _Surface:
    """Return a plane through the vertex, with the proven deviation that its tilt makes at the corners."""
    frame, half = glass.frame, glass.outline.half_width
    tilts = [frame.rotation.T @ face.samples[1][0] for face in glass.face.faces]
    slope = max(float(np.hypot(*tilt[:2]) / abs(tilt[2])) for tilt in tilts)
    rounding = 64 * EPS * float(np.abs(frame.shift).max() + max(half))
    return _Surface(FreeformSurface(half), slope * float(np.hypot(*half)) + rounding, "plane", True)


def _sphere(glass: GlassHeights) -> _Surface | None:
    """Return a sphere with its vertex on the axis, with the proven deviation that the place of its centre
    makes: with the centre e off the axis and d along it, d + e |grad z|."""
    face, frame, half = glass.face, glass.frame, glass.outline.half_width
    place, size = face.faces[0].centre, face.radius
    if place is None or size is None:
        return None
    centre = in_frame(frame, place) - (0.0, 0.0, glass.vertex)
    radius = float(np.copysign(size, centre[2]))
    off, along = float(np.hypot(*centre[:2])), abs(float(centre[2]) - radius)
    reach = float(np.hypot(*half)) + off
    if not is_one_surface(face.faces) or reach >= abs(radius):
        return None
    rounding = 64 * EPS * float(np.abs(frame.shift).max() + abs(radius))
    slope = reach / (radius**2 - reach**2) ** 0.5
    surface = FreeformSurface(half, Conic(radius, 0.0))
    return _Surface(surface, along + off * slope + rounding * (1 + slope), "conic", True)


def _graph(glass: GlassHeights) -> _Surface | None:
    """Return polynomial splines that are one graph with the same poles, with a proven deviation."""
    graph = spline_graph(glass.frame, glass.face.faces, glass.vertex)
    cut = None if graph is None else centred(graph.surface, np.array(glass.outline.half_width))
    if graph is None or cut is None:
        return None
    sag = THBSurface(THBSpace(cut.kv_u, cut.kv_v), cut.coefficients.ravel())
    surface = FreeformSurface((cut.kv_u.stop, cut.kv_v.stop), Conic(), sag)
    return _Surface(surface, graph.deviation, "spline as it is", True)


def _conic(glass: GlassHeights) -> _Surface | None:
    """Return the conic of revolution that a face is, or None."""
    x, y, z = glass.polar_samples()
    conic = conic_of(x, y, z) if np.isfinite(z).all() else None
    if conic is None:
        return None
    try:
        surface = FreeformSurface(glass.outline.half_width, conic)
    except ValueError:  # it ends within the box of a round lens
        return None
    deviation = glass.greatest_distance(surface, MEASURED)
    if deviation > CONIC:
        return None
    bound = None if conic.is_plane else _conic_bound(glass, conic)
    if bound is not None and bound <= CONIC:
        return _Surface(surface, bound, "conic", True)
    return _Surface(surface, deviation, "plane" if conic.is_plane else "conic", False)


def _conic_bound(glass: GlassHeights, conic: Conic) -> float | None:
    """Return a bound of the distance in z of one face from a conic, None where there is no use of one."""
    frame, face = glass.frame, glass.face
    spline = face.faces[0].exact_spline
    if len(face.faces) > 1 or spline is None:
        return None
    if isinstance(spline, BSplineSurface):
        spline = NURBSSurface.from_bspline(spline)
    points = in_frame(frame, spline.coefficients) - np.array([0.0, 0.0, glass.vertex])
    bound = conic_deviation(spline.kv_u, spline.kv_v, points, spline.weights, conic)
    if bound is None:
        return None
    reach = float(np.hypot(*points[..., :2].reshape(-1, 2).T).max())
    slope = reach / (conic.radius**2 - (1 + conic.constant) * reach**2) ** 0.5
    return bound + 64 * EPS * float(np.abs(frame.shift).max() + np.abs(points).max()) * (1 + slope)
