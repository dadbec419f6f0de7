"""Files without a CAD kernel: native JSON, the text of STEP files, meshes, tables of sag."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .atomic_files import json_text, write_bytes, write_files, write_text
    from .brep_measure import NotMeasured, areas, volume
    from .brep_records import MILLIMETRE, Brep, BrepCurve, BrepEdge, BrepFace, edge_span
    from .json_values import read_json
    from .lens_json import lens_from_dict, lens_to_dict, read_lens, write_lens
    from .mesh_files import obj_bytes, ply_bytes, require_single, stl_bytes, threemf_bytes
    from .parameter_curves import image_distance, turned_faces
    from .patch_deviation import patched_deviation
    from .sag_table import cloud_text, points_text, sag_text as sag_text, table_size as table_size
    from .spline_json import read_curve, read_surface, sag_from_dict, sag_to_dict, write_curve, write_surface
    from .step_brep import brep, brep_of_text, parse_brep as parse_brep
    from .step_text import Entities, Entity, Value, having, read_file, read_part21, rewritten
    from .step_values import direction_of, entities_of, entity_of, points_of

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
