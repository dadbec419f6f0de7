"""Files without a CAD kernel: native JSON, the text of STEP files, meshes, tables of sag."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .atomic_files import (
        json_text as json_text,
        write_bytes as write_bytes,
        write_files as write_files,
        write_text as write_text,
    )
    from .brep_measure import NotMeasured as NotMeasured, areas as areas, volume as volume
    from .brep_records import (
        MILLIMETRE as MILLIMETRE,
        Brep as Brep,
        BrepCurve as BrepCurve,
        BrepEdge as BrepEdge,
        BrepFace as BrepFace,
        edge_span as edge_span,
    )
    from .lens_json import (
        lens_from_dict as lens_from_dict,
        lens_to_dict as lens_to_dict,
        read_lens as read_lens,
        write_lens as write_lens,
    )
    from .mesh_files import (
        obj_bytes as obj_bytes,
        ply_bytes as ply_bytes,
        require_single as require_single,
        stl_bytes as stl_bytes,
        threemf_bytes as threemf_bytes,
    )
    from .parameter_curves import image_distance as image_distance, turned_faces as turned_faces
    from .patch_deviation import patched_deviation as patched_deviation
    from .sag_table import cloud_text as cloud_text, sag_text as sag_text, table_size as table_size
    from .spline_json import (
        read_curve as read_curve,
        read_surface as read_surface,
        sag_from_dict as sag_from_dict,
        sag_to_dict as sag_to_dict,
        write_curve as write_curve,
        write_surface as write_surface,
    )
    from .step_brep import brep as brep, brep_of_text as brep_of_text, parse_brep as parse_brep
    from .step_text import (
        Entity as Entity,
        Value as Value,
        having as having,
        read_file as read_file,
        read_part21 as read_part21,
        rewritten as rewritten,
    )
    from .step_values import (
        direction_of as direction_of,
        entity_of as entity_of,
        list_of as list_of,
        points_of as points_of,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
