"""A STEP file under test, read once by each of several programs that share no code, and its volume."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from optics.base.runtime import Check
from optics.exchange.verification.traced_faces import FaceRim
from thbcad.checks import Floats
from thbcad.io import Brep, BrepFace, edge_span, parse_brep, volume
from thbcad.lens import Lens, OpticalForm, edge_names, optical_places
from thbcad.sags import PlacedConic, conic_of_patch, conic_of_plane, conic_of_sphere, rectangle_around
from thbcad.splines import BSplineSurface

if TYPE_CHECKING:
    from thbcad.cad.exchange import SolidFile, SolidState
    from thbcad.moulds import Made, Plate


@dataclass(frozen=True)
class StepFile:
    """A STEP file, as a rule with a lens solid.

    Ask for `text` before `solid` where the file may be cut off or damaged: OCCT can end the process over it.
    """

    path: Path

    @cached_property
    def text(self) -> Brep:
        """What the text of the file holds.

        Raises OSError : the file cannot be read.  ValueError : it is not whole, or not one solid.
        """
        return parse_brep(self.path)

    @cached_property
    def rims(self) -> tuple[FaceRim, FaceRim]:
        """The curves round front and rear, of a file that holds a lens.

        Raises OSError, ValueError : as `text`; there are not two optical faces.
        """
        front, rear = (FaceRim(self.text, self.text.faces[k]) for k in optical_faces(self.text))
        return front, rear

    @cached_property
    def has_rims(self) -> bool:
        """Whether the curves of `rims` are known: other programs may write splines of a degree above 10."""
        faces = (self.text.faces[k] for k in optical_faces(self.text))
        return all(edge_span(edge) is not None for face in faces for edge in FaceRim.edges(self.text, face))

    @cached_property
    def state(self) -> SolidState:
        """What OCCT says of the shape in the file, a lens or another.

        Raises OSError : the file cannot be read.  ValueError : it is no STEP file.
        """
        from thbcad.cad.exchange import SolidState, step_shape  # OCCT

        return SolidState(step_shape(self.path))

    @cached_property
    def solid(self) -> SolidFile:
        """What OCCT reads in the file.

        Raises OSError : the file cannot be read.  ValueError : it does not hold two optical faces.
        """
        from thbcad.cad.exchange import read_step  # OCCT

        return read_step(self.path)

    def read(self) -> tuple[Brep, SolidState]:
        """Return `text` and `state`; the text is read first, so that a damaged file never reaches OCCT.

        Raises OSError, ValueError : as these.
        """
        return self.text, self.state

    def read_lens(self) -> tuple[Brep, SolidFile]:
        """Return `text` and `solid` of a file that holds a lens, the text first.

        Raises OSError, ValueError : as these; there are not two optical faces.
        """
        optical_faces(self.text)
        return self.text, self.solid


@dataclass(frozen=True, eq=False)
class ExportedStep:
    """A STEP file as OCCT reads it.

    Another process can return it without loading OCCT in this one.

    checks : of the solid.  front, rear : the optical faces in the file, as `SolidFile` has them.
    """

    checks: list[Check]
    front: OpticalForm
    rear: OpticalForm


def state_checks(state: SolidState, by: str, faces: int | None = None) -> list[Check]:
    """Return the Checks that a shape is one whole solid.

    by : what read the shape.  faces : how many it must have; without a number its shell must be closed.
    """
    counts = {"solids besides the one expected": abs(state.solids - 1)}
    if faces is not None:
        counts[f"faces besides the {faces} expected"] = abs(state.faces - faces)
    counts["free edges"] = state.free_edges
    if faces is None:
        counts["shell not closed"] = not state.closed
    counts["solid not valid"] = not state.valid
    return [Check.none_of(f"{name}, {by}", count) for name, count in counts.items()]


EXACT_VOLUME = 1e-10  # relative, of the text of a STEP file whose edges lie on its faces
FITTED_VOLUME = 1e-9  # the same, of edges within 1e-9 mm
MISCOUNTED = "optical faces where a lens has 2, front and rear"
COUNTS = {4: "four", 6: "six", 8: "eight", 10: "ten"}


def faces_besides(made: Made, found: int) -> tuple[str, int]:
    """Return what is counted, in words, and how many faces a solid has besides those of a lens, which are
    front, rear and one for every edge, or of its body."""
    expected = 2 + len(edge_names(made)) if isinstance(made, Lens) else made.face_count
    return f"faces besides the {COUNTS.get(expected, expected)} expected", abs(found - expected)


def text_solid_checks(solid: Brep, made: Made) -> list[Check]:
    """Return the Checks of what the text says of a whole solid: its volume, and the lenses of a plate."""
    limit = EXACT_VOLUME if isinstance(made, Lens) else FITTED_VOLUME
    volumes = [volume_check(solid, made.volume(), limit)]
    if isinstance(made, Lens):
        return volumes
    from thbcad.moulds import Plate  # lenses need none of its proofs

    return [*volumes, _like_lenses_check(solid, made)] if isinstance(made, Plate) else volumes


def _like_lenses_check(solid: Brep, plate: Plate) -> Check:
    """Return the Check of the fronts and rears of a plate: each the first one's numbers, plus its place."""
    from thbcad.moulds import FACES, named_on_plate  # as above

    faces, off = {face.name: face for face in solid.faces}, 0
    for number, (x, y) in enumerate(plate.places.tolist()):
        for own, name in zip(FACES, named_on_plate(FACES, number)):
            wanted = _numbers_at(faces[own], (x, y, 0.0))
            found = _numbers_at(faces[name]) if name in faces else []
            alike = [row.shape for row in found] == [row.shape for row in wanted]
            pairs = zip(found, wanted) if alike else ((np.array([np.nan]), row) for row in wanted)
            off += sum(int((a != b).sum()) for a, b in pairs)
    return Check.none_of("numbers of like lenses that are not those of the first, at their places", off)


def _numbers_at(face: BrepFace, place: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> list[Floats]:
    """Return the numbers of an optical face, elsewhere: of a spline, a plane or a sphere."""
    spline = face.surface
    if spline is not None:
        weights = [] if isinstance(spline, BSplineSurface) else [spline.weights]
        return [spline.coefficients + place, spline.kv_u.knots, spline.kv_v.knots, *weights]
    rows = face.plane if face.plane is not None else face.sphere
    return [] if rows is None else [rows[0] + place, *rows[1:]]


def volume_check(solid: Brep, wanted: float, limit: float) -> Check:
    """Return the Check of the volume by quadrature over the text against a wanted one, mm^3.

    limit : of the relative difference
    """
    try:
        off = abs(volume(solid) / wanted - 1)
    except ValueError:  # faces that do not close
        off = inf
    name = "volume by quadrature over the text of the file against the closed form, relative"
    return Check(name, off, limit, "")


def optical_faces(solid: Brep) -> tuple[int, int]:
    """Return the indices of front and rear among the faces.

    They are the faces of these names.  Where the names are missing or not unique, they are the lowest and the
    highest of the faces that are splines curved in both directions, or planes, spheres and patches of conics
    without holes across the middle: that of a spline, else that of the solid.

    Raises ValueError : there are not two.
    """
    places = optical_places([face.name for face in solid.faces])
    if places is not None:
        return places
    forms = {k: optical_form(solid, face) for k, face in enumerate(solid.faces)}
    centres = {k: middle_of(form) for k, form in forms.items() if isinstance(form, BSplineSurface)}
    if len(centres) > 2:
        raise ValueError(f"the file holds {len(centres)} {MISCOUNTED}")
    ends = np.concatenate([edge.ends for edge in solid.edges])
    middle = next(iter(centres.values()), (ends.min(axis=0) + ends.max(axis=0)) / 2)[:2]
    heights = {k: float(centre[2]) for k, centre in centres.items()}
    for k, form in forms.items():
        if isinstance(form, PlacedConic) and len(solid.faces[k].loops) == 1:
            own = face_corners(solid, solid.faces[k])[:, :2]
            if (own.min(axis=0) <= middle).all() and (middle <= own.max(axis=0)).all():
                heights[k] = float(form(*middle))
    order = sorted(heights, key=lambda k: heights[k])
    if len(order) < 2:
        raise ValueError(f"the file holds {len(order)} {MISCOUNTED}")
    return order[0], order[-1]


def middle_of(spline: BSplineSurface) -> Floats:
    """Return the point at the middle of the parameters of a spline, (3,), mm."""
    u, v = ((kv.start + kv.stop) / 2 for kv in (spline.kv_u, spline.kv_v))
    return spline([u], [v])[0]


def optical_form(solid: Brep, face: BrepFace) -> OpticalForm | None:
    """Return the surface under a face as a record; None unless it can be that of a front or a rear: a spline
    curved in both directions, a plane across z, a sphere or a patch of a conic around z."""
    surface = face.surface
    if isinstance(surface, BSplineSurface):
        # the ruled edges are straight in one direction
        return surface if min(surface.kv_u.degree, surface.kv_v.degree) > 1 else None
    corners = face_corners(solid, face)
    half_width = rectangle_around(corners)
    if face.plane is not None:
        return conic_of_plane(face.plane, half_width)
    if face.sphere is not None:
        below = bool(corners[:, 2].sum() < len(corners) * face.sphere[0, 2])
        return conic_of_sphere(face.sphere[:3], float(face.sphere[3, 0]), below, half_width)
    return None if surface is None else conic_of_patch(surface, half_width)


def face_corners(solid: Brep, face: BrepFace) -> Floats:
    """Return the ends of the edges around a face, (n, 3), mm."""
    numbers = {number for loop in face.loops for number, _ in loop}
    ends = [edge.ends for edge in solid.edges if edge.number in numbers]
    return np.concatenate(ends) if ends else np.empty((0, 3))
