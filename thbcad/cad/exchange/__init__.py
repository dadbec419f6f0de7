"""STEP, IGES and BREP in and out; hand-over to build123d and cadquery."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .face_points import (
        FaceNodes as FaceNodes,
        face_hits as face_hits,
        face_nodes as face_nodes,
        step_solid as step_solid,
    )
    from .handover import (
        GLASS as GLASS,
        library as library,
        named_faces as named_faces,
        to_build123d as to_build123d,
        to_cadquery as to_cadquery,
    )
    from .iges_brep_solids import (
        brep_bytes as brep_bytes,
        iges_bytes as iges_bytes,
        part_iges as part_iges,
        read_brep as read_brep,
        read_iges as read_iges,
    )
    from .loose_splines import (
        read_curves as read_curves,
        read_faces as read_faces,
        write_curves as write_curves,
        write_faces as write_faces,
    )
    from .occt_texts import brep_text as brep_text, compact as compact, silence as silence
    from .part_triangles import face_triangles as face_triangles, part_mesh as part_mesh
    from .reading import (
        OCCT_ERRORS as OCCT_ERRORS,
        brep_shape as brep_shape,
        edges_of as edges_of,
        explore as explore,
        faces_of as faces_of,
        iges_shape as iges_shape,
        step_shape as step_shape,
    )
    from .scene_file import (
        PlacedShape as PlacedShape,
        read_scene as read_scene,
        scene_step as scene_step,
        sheet_part as sheet_part,
    )
    from .solid_file import (
        SolidFile as SolidFile,
        SolidState as SolidState,
        conic_faces as conic_faces,
        optical_form as optical_form,
        solid_volume as solid_volume,
        spline_faces as spline_faces,
    )
    from .step import (
        part_of as part_of,
        part_step as part_step,
        product_of as product_of,
        read_step as read_step,
        step_bytes as step_bytes,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
