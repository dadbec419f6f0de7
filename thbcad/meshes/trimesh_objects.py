"""The mesh of a lens as an object of trimesh."""

import numpy as np
import trimesh

from thbcad.cad.shapes import Part
from thbcad.checks import require_type
from thbcad.lens import Lens, Tessellation, face_colour
from thbcad.meshes.bodies import body_mesh

OPAQUE = 255


def to_trimesh(lens: Lens | Part | Tessellation, chord: float = 1e-3) -> trimesh.Trimesh:
    """Return a watertight trimesh.Trimesh in mm; every face of the lens has its colour.

    lens : Lens; Part, such as those of apertures and flanges; or a mesh that is there already, such as of
        `body_mesh`
    chord : mm, the error that the mesh may have: proven of a Lens, measured of a Part.

    metadata has `chord` (what is kept, mm), `names` of the faces, and `faces`, the face of each triangle.

    Raises ImportError : trimesh is not installed.
    Raises ValueError : as `body_mesh` and `part_mesh`; something else than these three.
    """
    require_type("lens", lens, Lens, Part, Tessellation)
    if isinstance(lens, Part):
        from thbcad.cad.exchange import part_mesh  # OCCT

        mesh = part_mesh(lens, chord)
    else:
        mesh = body_mesh(lens, chord) if isinstance(lens, Lens) else lens
    colours = np.array(
        [[*(round(OPAQUE * part) for part in face_colour(name)), OPAQUE] for name in mesh.names]
    )
    made = trimesh.Trimesh(
        mesh.vertices,
        mesh.triangles,
        face_colors=colours[mesh.faces].astype(np.uint8),
        metadata={"chord": mesh.chord, "names": mesh.names, "faces": mesh.faces},
        process=False,
    )
    made.units = "mm"
    return made
