"""Whether a Lens is the glass of the solid that it was made of: areas and volumes, face by face.

The Lens must have the integral of z over each optical face, as seen along the axis.  No other face may lie
within the outline of front and rear.  Then the glass within the outline is the same; what is left of the
difference in volume lies outside: chamfers, flanges, barrels.
"""

from collections.abc import Sequence

import numpy as np
from OCP.BRepGProp import BRepGProp
from OCP.gp import gp_Dir, gp_Pln, gp_Pnt
from OCP.GProp import GProp_GProps

from thbcad.cad.foreign.face_groups import INTEGRAL, rim_points
from thbcad.cad.foreign.optical_surface import OpticalFace, in_frame
from thbcad.cad.foreign.surveyed_faces import SurveyedFace
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.outlines import integral_within
from thbcad.poses import Pose

VOLUME = 1e-6  # relative: how well the volumes of lens and solid must agree
RIM = 1e-3  # relative: faces that reach less far over the outline begin at it, as chamfers do


def require_same_faces(frame: Pose, faces: Sequence[OpticalFace], lens: Lens, volume: float) -> None:
    """Raise ValueError unless front and rear of a lens hold the same glass as the faces, within 1e-6 of the
    volume of the solid, mm^3.  Where a chamfer made a rim, the difference in area counts with its height."""
    for (name, surface, vertex), face, graph in zip(lens.faces, faces, lens.graphs()):
        own = _integral_over(frame, face, vertex)
        made = integral_within(graph, surface.outline.pieces)
        rim = in_frame(frame, rim_points([edge for one in face.faces for edge in one.edges]))[:, 2] - vertex
        area = abs(face.rim.area - surface.outline.area)
        apart = abs(own - made)
        if apart > VOLUME * volume + area * float(np.abs(rim).max()):
            raise ValueError(
                f"the {name} is not the {face.described()} of the file, which may have an opening: over the "
                f"plane through its vertex the file has {own:.9g} mm^3, the Lens {made:.9g} mm^3"
            )


def _integral_over(frame: Pose, face: OpticalFace, vertex: float) -> float:
    """Return the integral of z, less that of the vertex, over the shadow of a face, mm^3."""
    normal = frame.rotation[:, 2]
    plane = gp_Pln(gp_Pnt(0, 0, 0), gp_Dir(*normal.tolist()))  # OCCT mistakes the side of any other
    total = 0.0
    for one in face.faces:
        properties = GProp_GProps()
        BRepGProp.VolumePropertiesGK_s(one.face, properties, plane, INTEGRAL, False, True)
        total += properties.Mass()
    outward = face.faces[0].samples[1].mean(axis=0) @ normal
    height = float(frame.shift @ normal) + vertex
    return (total if outward > 0 else -total) - height * face.rim.area


def require_nothing_within(
    frame: Pose, solid: Sequence[SurveyedFace], faces: Sequence[OpticalFace], lens: Lens
) -> None:
    """Raise ValueError where another face of the solid lies in the shadow of front and rear."""
    optical = {one.number for face in faces for one in face.faces}
    for other in (face for face in solid if face.number not in optical):
        points = in_frame(frame, np.concatenate([other.samples[0], rim_points(other.edges)]))
        gauges = [surface.outline.gauge(*points[:, :2].T) for _, surface, _ in lens.faces]
        gauge = np.max(gauges, axis=0)  # of the smaller outline
        inmost = int(np.argmin(gauge))
        if gauge[inmost] < 1 - RIM:
            raise ValueError(
                f"the solid has another face, a {other.kind}, within the outline of front and rear, at "
                f"{_place(points[inmost])}: a Lens is glass between two surfaces"
            )


def _place(point: Floats) -> str:
    x, y, z = (round(value, 6) + 0.0 for value in point.tolist())
    return f"x = {x:.6g}, y = {y:.6g}, z = {z:.6g} mm"
