"""Lenses as parts of build123d and cadquery, joined with others, and written with their own numbers."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .build123d_lens import LensPart as LensPart
    from .cadquery_lens import workplane as workplane
    from .face_measures import (
        edge_deviation as edge_deviation,
        face_deviation as face_deviation,
        inner_wires as inner_wires,
        outline_segments as outline_segments,
        own_edges as own_edges,
        projected_area as projected_area,
        rim_faces as rim_faces,
    )
    from .faces_in_regions import (
        edges_within as edges_within,
        faces_within as faces_within,
        on_face as on_face,
    )
    from .mount_solids import mounted_part as mounted_part
    from .numbers_of_surfaces import surface_numbers as surface_numbers
    from .operations import cut as cut, join as join
    from .search import PlacedLens as PlacedLens, placed_lens as placed_lens
    from .writing import exact_part as exact_part, placed_step as placed_step, write_step as write_step

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
