"""The faces of elements as surfaces of a light path: where they lie, and what light does there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from optics.scene.paths import Surface
from optics.scene.problem import FaceMet, MirrorElement, Optic, Placed
from thbcad.lens import FreeformSurface, Lens
from thbcad.outlines import Outline
from thbcad.poses import IDENTITY, Pose
from thbcad.sags import Conic

TURNED = Pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))  # of a surface that light meets from its +z


def pose_of(optic: Optic) -> Pose:
    """Return the pose from the frame of an element, with its front vertex at 0, to that of the scene."""
    return Pose.tilted(optic.position, optic.tilt) if isinstance(optic, Placed) else IDENTITY


def clear_aperture_of(optic: Optic, lens: Lens) -> tuple[Outline, Outline] | None:
    """Return what a holder leaves free of front and rear of an element's lens; None is all."""
    if not any(optic.clear_aperture):
        return None
    front, rear = (s.outline.scaled(optic.clear(s.half_width)) for s in (lens.front, lens.rear))
    return front, rear


def surface_of(face: FaceMet, lens: Lens) -> Surface:
    """Return a face as light meets it, going to the surface's own +z.  lens : of its element, its blank."""
    optic, rear = face.optic, face.face == "rear"
    shape, pose = (lens.rear, _behind(lens)) if rear else (lens.front, IDENTITY)
    pose = pose_of(optic) @ pose
    if face.backwards:
        shape, pose = _from_behind(shape), pose @ TURNED
    clear = clear_aperture_of(optic, lens)
    surface = Surface(shape, pose, clear=clear[rear] if clear else None)
    if isinstance(optic, MirrorElement):
        return replace(surface, kind="reflect", share=optic.share)
    passing = optic.coats[rear]
    if not face.reflects:
        return replace(surface, share=passing)
    return replace(surface, kind="reflect", share=None if passing is None else 1 - passing)


def _behind(lens: Lens) -> Pose:
    return Pose.at((0.0, 0.0, lens.thickness))


def _from_behind(shape: FreeformSurface) -> FreeformSurface:
    """Return a surface without a sag as seen from its +z, turned about its x: -z(x, -y)."""
    assert shape.sag is None
    return replace(shape, conic=Conic(-shape.conic.radius, shape.conic.constant))
