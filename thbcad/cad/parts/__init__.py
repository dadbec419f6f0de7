"""Lenses as parts of build123d and cadquery, joined with others, and written with their own numbers."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from thbcad.cad.parts.build123d_lens import LensPart as LensPart
    from thbcad.cad.parts.cadquery_lens import workplane as workplane
    from thbcad.cad.parts.face_measures import (
        edge_deviation as edge_deviation,
        face_deviation as face_deviation,
        inner_wires as inner_wires,
        outline_segments as outline_segments,
        own_edges as own_edges,
        projected_area as projected_area,
        rim_faces as rim_faces,
    )
    from thbcad.cad.parts.faces_in_regions import (
        edges_within as edges_within,
        faces_within as faces_within,
        on_face as on_face,
    )
    from thbcad.cad.parts.mount_solids import mounted_part as mounted_part
    from thbcad.cad.parts.numbers_of_surfaces import surface_numbers as surface_numbers
    from thbcad.cad.parts.operations import cut as cut, join as join
    from thbcad.cad.parts.search import PlacedLens as PlacedLens, placed_lens as placed_lens
    from thbcad.cad.parts.writing import (
        exact_part as exact_part,
        placed_step as placed_step,
        write_step as write_step,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
