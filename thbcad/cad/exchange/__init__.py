"""STEP, IGES and BREP in and out; hand-over to build123d and cadquery."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .face_points import FaceNodes, face_hits, face_nodes, first_hit, point_and_normal, step_solid
    from .handover import GLASS, library, named_faces, to_build123d, to_cadquery
    from .iges_brep_solids import brep_bytes, iges_bytes, part_iges, read_brep, read_iges
    from .loose_splines import read_curves, read_faces, write_curves, write_faces
    from .occt_texts import brep_text, compact, occt_settings, silence
    from .part_triangles import face_triangles, part_mesh
    from .reading import OCCT_ERRORS, brep_shape, edges_of, explore, faces_of, iges_shape, step_shape
    from .scene_file import PlacedShape, read_scene, scene_step, sheet_part
    from .solid_file import (
        SolidFile,
        SolidState,
        conic_faces,
        optical_form,
        solid_area,
        solid_volume,
        spline_faces,
    )
    from .step import part_of, part_step, product_of, read_step, step_bytes

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
