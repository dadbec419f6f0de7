"""Whether a Lens is the glass of the solid that it was made of.

An optical face must have the area of its outline, as seen along the axis: else it has an opening.  No other
face may lie within the outline of front and rear.  Then the glass between the surfaces is the same, and a
solid that nowhere reaches over the outline must have the volume of the Lens.  One that does has chamfers,
flanges or a barrel, which a Lens does not.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from thbcad.cad.foreign.face_groups import rim_points
from thbcad.cad.foreign.optical_surface import OpticalFace, in_frame
from thbcad.cad.foreign.surveyed_faces import SurveyedFace
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.outlines import Outline
from thbcad.poses import Pose

AREA = VOLUME = 1e-6  # relative: how well areas and volumes must agree
RIM = 1e-3  # relative: faces that reach less far over or under the outline begin at it, as chamfers do

WAYS = 8  # steps to a point's share of the way along a wall, whose height varies round the rim


def require_whole(faces: Sequence[OpticalFace]) -> None:
    """Raise ValueError unless front and rear fill their outlines; that within a chamfer is smaller by up to
    the share by which its rim is no ellipse."""
    for name, face in zip(("front", "rear"), faces):
        filled, whole = face.rim.area, face.rim.nearest.area
        rim = 4 * face.rim.apart * float(face.half_width.sum())
        if abs(filled - whole) > AREA * whole + rim:
            raise ValueError(
                f"the {name}, a {face.described()}, fills {filled:.9g} mm^2 of the {whole:.9g} mm^2 of its "
                f"outline: it has an opening of {whole - filled:.6g} mm^2; a Lens has none"
            )


def require_same_glass(
    frame: Pose,
    solid: Sequence[SurveyedFace],
    faces: Sequence[OpticalFace],
    lens: Lens,
    volumes: tuple[float, float],
) -> None:
    """Raise ValueError where another face of the solid lies in the shadow of front and rear, or where a solid
    that ends at the outline has another volume.

    solid : its faces.  volumes : of the lens and of the solid, mm^3
    """
    reaches_over = False
    for other, points, gauges in _walls(frame, solid, faces, lens):
        inmost = int(np.argmin(gauges.max(axis=0)))
        if gauges[:, inmost].max() < 1 - RIM:  # within the smaller outline
            raise ValueError(
                f"the solid has another face, a {other.kind}, within the outline of front and rear, at "
                f"{_place(points[inmost])}: a Lens is glass between two surfaces"
            )
        reaches_over |= bool(gauges.max() > 1 + RIM)
    own, exact = volumes
    if own > (1 + VOLUME) * exact or (not reaches_over and abs(own - exact) > VOLUME * exact):
        raise ValueError(
            f"the Lens of these surfaces has {own:.9g} mm^3, the solid {exact:.9g} mm^3: the walls between "
            f"front ({faces[0]!r}) and rear ({faces[1]!r}) are not those of a Lens"
        )


def cut_by_walls(
    frame: Pose, solid: Sequence[SurveyedFace], faces: Sequence[OpticalFace], lens: Lens
) -> bool:
    """Return whether another face of the solid lies within the straight walls from rim to rim of a Lens.

    solid : its faces.
    """
    sizes = np.array([surface.half_width for _, surface, _ in lens.faces])
    unit = Outline((1.0, 1.0), lens.front.outline.relative_corners)
    for _, points, _ in _walls(frame, solid, faces, lens):
        share = np.full(len(points), 0.5)  # of the way along the wall, from the front
        for _ in range(WAYS):
            across = np.outer(1 - share, sizes[0]) + np.outer(share, sizes[1])
            on_unit = points[:, :2] / across
            gauge = np.maximum(unit.gauge(*on_unit.T), RIM)
            rim = on_unit / gauge[:, None]
            low, high = (
                vertex + surface(*(rim * size).T) for (_, surface, vertex), size in zip(lens.faces, sizes)
            )
            share = np.clip((points[:, 2] - low) / (high - low), 0.0, 1.0)
        if ((gauge < 1 - RIM) & (share > RIM) & (share < 1 - RIM)).any():
            return True
    return False


def _walls(
    frame: Pose, solid: Sequence[SurveyedFace], faces: Sequence[OpticalFace], lens: Lens
) -> Iterator[tuple[SurveyedFace, Floats, Floats]]:
    """Yield the faces besides front and rear, with points (n, 3) of each in the frame of the lens, and the
    gauges of these in the outlines of front and rear, (2, n)."""
    optical = {one.number for face in faces for one in face.faces}
    for other in (face for face in solid if face.number not in optical):
        points = in_frame(frame, np.concatenate([other.samples[0], rim_points(other.edges)]))
        yield (
            other,
            points,
            np.array([surface.outline.gauge(*points[:, :2].T) for _, surface, _ in lens.faces]),
        )


def _place(point: Floats) -> str:
    x, y, z = (round(value, 6) + 0.0 for value in point.tolist())
    return f"x = {x:.6g}, y = {y:.6g}, z = {z:.6g} mm"
