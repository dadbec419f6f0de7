"""One optical surface of a solid, of one face or of several, and the axis of a lens and its frame, from the
geometry of its faces alone.

A spline S(u, v) in graph form is A + u a + v b + z(u, v) n.  Its poles less their best affine function of
the Greville abscissae are then multiples of n: the first right singular vector of what is left is the axis,
and the other singular values show how far the surface is from graph form.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thbcad.cad.foreign.face_groups import outer_edges, reach, rim_edges, rim_points, shadow_area
from thbcad.cad.foreign.face_outlines import FaceOutline, face_outline
from thbcad.cad.foreign.surveyed_faces import SurveyedFace
from thbcad.checks import Floats
from thbcad.poses import Pose
from thbcad.splines import BSplineSurface, NURBSSurface

GRAPH = 1e-3  # of the first singular value: the second, up to which a spline counts as a graph
NEAR = 0.9  # cosine between an axis and the mean normal of the surface: 25 degrees
ELLIPSE = 1e-6  # of the size of a rim, by which it may be off an ellipse
ELLIPTIC = 1e-4  # relative difference of the squares of axes, from which an ellipse has directions
SNAP = 1e-12  # directions nearer to an axis of the file are it
SAME = 1e-9  # between unit vectors; relative: of places and radii
ALIKE = 1 - 1e-6  # cosine: within 1.4 mrad of a direction of planes or cylinders, that one is meant
PLANE_RIM = 1e-7  # of the size of a rim: how well it must lie in a plane
CHAMFERED = 1e-3  # of the half-width: so far off the axis is the rim that a chamfer leaves


def in_frame(frame: Pose, points: Floats) -> Floats:
    """Return points of the file, (..., 3), in the frame of a lens."""
    return frame.inverse().points(points.T).T


def lens_axes(group: Sequence[SurveyedFace], faces: Sequence[SurveyedFace]) -> Floats:
    """Return the unit vectors x, y, z of a lens as columns, (3, 3): a rotation.

    z is the axis of the graph, of revolution, of a cylinder, along planes, or across a plane rim, whichever
    of these comes first and is within 25 degrees of the mean normal of an optical surface, the faces `group`.
    That stands in where there is none.  z points to where that axis of the file grows that it is nearest to;
    x is as near as it can to the file's.
    """
    main, rim = group[0], rim_points(rim_edges(group))
    mean = _unit(np.sum([face.area * face.samples[1].mean(axis=0) for face in group], axis=0))
    round_ = sorted((f for f in faces if not f.is_flat), key=lambda f: -f.area)
    exact = [*(d for f in round_ if (d := f.direction) is not None), *_of_planes(faces)]
    found = [*_graph_directions(main)[:1], *exact, *_across_plane(rim)]
    axis = next((d for d in found if abs(d @ mean) > NEAR), mean)
    axis = next((d for d in exact if abs(d @ axis) > ALIKE), axis)
    size = np.round(np.abs(axis[::-1]), 9)
    dominant = 2 - int(np.argmax(size))
    axis = _snapped(axis * np.sign(axis[dominant]))
    x = _x_direction(main, faces, rim, axis)
    return np.column_stack([x, _snapped(np.cross(axis, x)), axis])


def graph_residual(spline: BSplineSurface) -> tuple[Floats, Floats]:
    """Return the coefficients of the best affine function of the Greville abscissae, (3, 3), rows for 1, u
    and v, and what is left of the poles, (n, 3)."""
    u, v = np.meshgrid(spline.kv_u.greville(), spline.kv_v.greville(), indexing="ij")
    columns = np.column_stack([np.ones(u.size), u.ravel(), v.ravel()])
    poles = spline.coefficients.reshape(-1, 3)
    affine = np.asarray(np.linalg.lstsq(columns, poles, rcond=None)[0], dtype=np.float64)
    return affine, poles - columns @ affine


def _graph_directions(face: SurveyedFace) -> list[Floats]:
    """Return n, a and b of a polynomial spline in graph form, [] of others."""
    spline = face.spline
    if not isinstance(spline, BSplineSurface):
        return []
    affine, rest = graph_residual(spline)
    _, values, rows = np.linalg.svd(rest, full_matrices=False)
    if values[1] > GRAPH * values[0]:
        return []
    n = rows[0]
    return [n, *(_unit(row - (row @ n) * n) for row in affine[1:])]


def _of_planes(faces: Sequence[SurveyedFace]) -> list[Floats]:
    """Return the directions along two planes, and the normals of planes, those of large faces first."""
    ordered = sorted((f for f in faces if f.is_flat), key=lambda f: -f.area)
    normals = [d for f in ordered if (d := f.direction) is not None]
    crossed = [np.cross(a, b) for k, a in enumerate(normals) for b in normals[k + 1 :]]
    return [_unit(d) for d in crossed if np.linalg.norm(d) > 0.1] + normals


def _across_plane(points: Floats) -> list[Floats]:
    """Return the normal of the plane that holds points (n, 3), [] where none does."""
    if len(points) < 3:
        return []
    _, sizes, rows = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return [rows[2]] if sizes[2] < PLANE_RIM * sizes[1] else []


def _x_direction(main: SurveyedFace, faces: Sequence[SurveyedFace], rim: Floats, axis: Floats) -> Floats:
    """Return the direction of a side, or of a parameter line, that is nearest to the file's x axis."""
    graph = [_unit(d - (d @ axis) * axis) for d in _graph_directions(main)[1:]]
    walls = [d for d in _of_planes(faces) if abs(d @ axis) < SAME]
    if main.is_ruled and not main.is_flat and main.direction is not None:
        walls.insert(0, _unit(main.direction - (main.direction @ axis) * axis))
    alike = [d for d in walls if not graph or any(abs(d @ g) > ALIKE for g in graph)]
    candidates = [d for one in alike or graph for d in (one, np.cross(axis, one))]
    toward = np.eye(3)[0] if abs(axis[0]) < 0.9 else np.eye(3)[1]
    level = np.array([(own := _unit(toward - (toward @ axis) * axis)), np.cross(axis, own)])
    candidates = candidates or [*(_ellipse_axes(rim @ level.T) @ level), level[0]][:2]
    best = max(candidates, key=lambda d: abs(round(float(d @ toward), 9)))
    best = best - (best @ axis) * axis
    return _snapped(best * (1 if best @ toward >= 0 else -1))


def _ellipse_axes(points: Floats) -> Floats:
    """Return the axes of the ellipse on which points (n, 2) lie as rows, (2, 2), (0, 2) where they lie on a
    circle or on no ellipse.

    Fitted is the quadratic polynomial without constant that is 1 on the ellipse.
    """
    none = np.empty((0, 2))
    if len(points) < 5:
        return none
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = ((points - (low + high) / 2) / (high - low).max()).T
    columns = np.column_stack([x * x, 2 * x * y, y * y, x, y])
    form, *_ = np.linalg.lstsq(columns, np.ones(len(x)), rcond=None)
    values, axes = np.linalg.eigh(form[[0, 1, 1, 2]].reshape(2, 2))
    beside = np.abs(columns @ form - 1).max()
    round_ = values[1] - values[0] < ELLIPTIC * abs(values[1])
    return none if beside > ELLIPSE or values[0] <= 0 or round_ else axes.T


def _unit(vector: Floats) -> Floats:
    return vector / (np.linalg.norm(vector) or 1.0)


def _snapped(direction: Floats) -> Floats:
    """Return the direction, or the axis of the file that it is but for rounding."""
    rounded = np.round(direction)
    return rounded + 0.0 if np.abs(direction - rounded).max() < SNAP else _unit(direction)


@dataclass(frozen=True, eq=False)
class OpticalFace:
    """One optical surface of a solid.

    kind : "plane", "sphere", "cylinder", "spline", "rational spline", "surface of revolution", ...
    radius : float, mm, of a sphere or a cylinder, else None
    faces : SurveyedFace, one or, where the surface was split, several
    rim : FaceOutline, seen along the axis
    half_width : (2,) of the box round the outline, mm.  centre : (2,) of that box in the lens's frame, mm;
        of the sphere, where the rim is centred on it but for what a chamfer leaves
    degrees, control_points : (2,) int of a spline in one piece, else None
    knots : the knot vectors in u and v of a spline in one piece, else None
    periodic : whether the surface of a face closes in u, in v
    graph_deviation : float, mm, of a polynomial spline in one piece, else None.  x and y are nowhere farther
        from affine functions of the parameters: a bound, by the poles.
    """

    kind: str
    radius: float | None
    faces: tuple[SurveyedFace, ...]
    rim: FaceOutline
    half_width: Floats
    centre: Floats
    degrees: tuple[int, int] | None
    control_points: tuple[int, int] | None
    knots: tuple[Floats, Floats] | None
    periodic: tuple[bool, bool]
    graph_deviation: float | None

    def is_revolved_around(self, frame: Pose) -> bool:
        """Whether all of it is on surfaces of revolution around the axis of a frame."""
        axis = frame.rotation[:, 2]
        for face in self.faces:
            direction, point = face.direction, face.axis_point
            if direction is None or point is None or np.linalg.norm(np.cross(direction, axis)) > SAME:
                return False
            if np.abs(in_frame(frame, point)[:2]).max() > SAME * float(self.half_width.max()):
                return False
        return True

    @property
    def outline(self) -> str:
        """ "rectangle", "rounded" (a rectangle with round corners), "ellipse" or "other"."""
        return self.rim.word

    def described(self) -> str:
        """Return its kind, with its radius."""
        return self.kind if self.radius is None else f"{self.kind} of radius {self.radius:.9g} mm"

    def __repr__(self) -> str:
        a, b = 2 * self.half_width
        parts = [f"{self.described()} in {len(self.faces)} face{'s' * (len(self.faces) > 1)}"]
        if self.degrees and self.control_points:
            p, q = self.degrees
            parts.append(f"degree {p} x {q}, {self.control_points[0]} x {self.control_points[1]} poles")
        if self.graph_deviation is not None:
            parts.append(f"{self.graph_deviation:.2g} mm from graph form")
        return ", ".join([*parts, f"{self.outline} of {a:.6g} x {b:.6g} mm"])


def optical_face(group: list[SurveyedFace], frame: Pose) -> OpticalFace:
    """Return what is known of an optical surface in a frame."""
    edges = rim_edges(group)
    outer = outer_edges(edges)
    axes = frame.rotation.T[:2]
    ends = np.array([[reach(outer, way * d) for d in axes] for way in (-1, 1)])
    low, high = ends * [[-1], [1]] - axes @ frame.shift
    half, centre = (high - low) / 2, (high + low) / 2
    points = in_frame(frame, rim_points(outer))[:, :2] - centre
    rim = face_outline(points, half, shadow_area(outer, frame))
    rim = replace(rim, area=shadow_area(edges, frame))
    if rim.word != "rectangle" and (middle := group[0].centre) is not None:
        apart = in_frame(frame, middle)[:2] - centre
        centre = centre + apart * (np.abs(apart).max() < CHAMFERED * half.max())
    spline = group[0].spline if is_one_surface(group) else None
    deviation = None
    if isinstance(spline, BSplineSurface):  # between those of the poles
        _, rest = graph_residual(spline)
        deviation = float(np.linalg.norm(rest @ axes.T, axis=1).max())
    kind = group[0].kind
    if isinstance(group[0].spline, NURBSSurface):
        kind = "rational spline"
    return OpticalFace(
        kind=kind,
        radius=group[0].radius,
        faces=tuple(group),
        rim=rim,
        half_width=half,
        centre=centre,
        degrees=None if spline is None else (spline.kv_u.degree, spline.kv_v.degree),
        control_points=None if spline is None else (spline.kv_u.dim, spline.kv_v.dim),
        knots=None if spline is None else (spline.kv_u.knots, spline.kv_v.knots),
        periodic=group[0].periodic,
        graph_deviation=deviation,
    )


def is_one_surface(group: Sequence[SurveyedFace]) -> bool:
    """Return whether faces are parts of one sphere, or of one spline with the same numbers; one face is."""
    first, others = group[0], group[1:]
    if first.kind == "sphere":
        numbers = [
            [*face.centre.tolist(), face.radius]
            for face in group
            if face.centre is not None and face.radius is not None
        ]
        return len(numbers) == len(group) and bool(np.ptp(numbers, axis=0).max() <= SAME * numbers[0][3])
    spline = first.spline
    return not others or (
        spline is not None and all(f.spline is not None and _equal(spline, f.spline) for f in others)
    )


def _equal(spline: BSplineSurface | NURBSSurface, other: BSplineSurface | NURBSSurface) -> bool:
    """Return whether two splines have the same numbers."""
    pairs = [(kv.knots, own.knots) for kv, own in zip(spline.knot_vectors, other.knot_vectors)]
    pairs.append((spline.coefficients, other.coefficients))
    if isinstance(spline, NURBSSurface) and isinstance(other, NURBSSurface):
        pairs.append((spline.weights, other.weights))
    return type(spline) is type(other) and all(np.array_equal(a, b) for a, b in pairs)
