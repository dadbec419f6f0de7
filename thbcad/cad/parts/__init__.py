"""Lenses as parts of build123d and cadquery, joined with others, and written with their own numbers."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .build123d_lens import LensPart
    from .cadquery_lens import workplane
    from .face_measures import (
        edge_deviation,
        face_deviation,
        inner_wires,
        outline_segments,
        own_edges,
        projected_area,
        rim_faces,
    )
    from .faces_in_regions import edges_within, faces_within, on_face
    from .mount_solids import mounted_part
    from .numbers_of_surfaces import surface_numbers
    from .operations import cut, join
    from .search import PlacedLens, placed_lens
    from .writing import exact_part, placed_step, write_step

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
