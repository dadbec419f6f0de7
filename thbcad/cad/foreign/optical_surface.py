"""One optical surface of a solid, of one face or of several, and what is known of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thbcad.cad.foreign.lens_frame import graph_residual, in_frame
from thbcad.cad.foreign.surveyed_faces import SurveyedFace
from thbcad.checks import Floats
from thbcad.poses import Pose
from thbcad.splines import BSplineSurface, NURBSSurface

ROUND = 1e-6  # relative: how well an outline must be a rectangle or an ellipse


@dataclass(frozen=True, eq=False)
class OpticalFace:
    """One optical surface of a solid.

    kind : "plane", "sphere", "cylinder", "spline", "rational spline", "surface of revolution", ...
    radius : float, mm, of a sphere or a cylinder, else None
    faces : SurveyedFace, one or, where the surface was split, several
    outline : "rectangle", "ellipse" or "other", seen along the axis
    half_width : (2,) of the box round the outline, mm.  centre : (2,) of that box in the lens's frame, mm
    degrees, control_points : (2,) int of a spline in one piece, else None
    knots : the knot vectors in u and v of a spline in one piece, else None
    periodic : whether the surface of a face closes in u, in v
    graph_deviation : float, mm, of a polynomial spline in one piece, else None.  x and y are nowhere farther
        from affine functions of the parameters: a bound, by the poles.
    """

    kind: str
    radius: float | None
    faces: tuple[SurveyedFace, ...]
    outline: str
    half_width: Floats
    centre: Floats
    degrees: tuple[int, int] | None
    control_points: tuple[int, int] | None
    knots: tuple[Floats, Floats] | None
    periodic: tuple[bool, bool]
    graph_deviation: float | None

    def __repr__(self) -> str:
        a, b = 2 * self.half_width
        size = "" if self.radius is None else f" of radius {self.radius:.9g} mm"
        parts = [f"{self.kind}{size} in {len(self.faces)} face{'s' * (len(self.faces) > 1)}"]
        if self.degrees and self.control_points:
            p, q = self.degrees
            parts.append(f"degree {p} x {q}, {self.control_points[0]} x {self.control_points[1]} poles")
        if self.graph_deviation is not None:
            parts.append(f"{self.graph_deviation:.2g} mm from graph form")
        return ", ".join([*parts, f"{self.outline} of {a:.6g} x {b:.6g} mm"])


def optical_face(group: list[SurveyedFace], frame: Pose) -> OpticalFace:
    """Return what is known of an optical surface in a frame."""
    outline = in_frame(frame, np.concatenate([face.rim for face in group]))[:, :2]
    axes = frame.rotation.T[:2]
    reach = np.array([[max(f.reach(way * d) for f in group) for d in axes] for way in (-1, 1)])
    low, high = reach * [[-1], [1]] - axes @ frame.shift
    half, centre = (high - low) / 2, (high + low) / 2
    spline = group[0].spline if len(group) == 1 else None
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
        outline=_outline_kind((outline - centre) / half),
        half_width=half,
        centre=centre,
        degrees=None if spline is None else (spline.kv_u.degree, spline.kv_v.degree),
        control_points=None if spline is None else (spline.kv_u.dim, spline.kv_v.dim),
        knots=None if spline is None else (spline.kv_u.knots, spline.kv_v.knots),
        periodic=group[0].periodic,
        graph_deviation=deviation,
    )


def _outline_kind(relative: Floats) -> str:
    """Return what an outline is whose box is [-1, 1] x [-1, 1]."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    gaps = np.linalg.norm(relative[:, None] - corners, axis=2).min(axis=0)
    if gaps.max() < ROUND:
        return "rectangle"
    outer = np.hypot(*relative.T)
    return "ellipse" if outer.max() < 1 + ROUND and outer.min() > 1 - ROUND else "other"
