"""The closed lens, its rims and edges, and what can be proven of it."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .cuts import (
        Flange as Flange,
        aperture_volume as aperture_volume,
        flanged_volume as flanged_volume,
        polygon_volume as polygon_volume,
        require_aperture as require_aperture,
        require_clear as require_clear,
        require_polygon as require_polygon,
        rim_heights as rim_heights,
        walls_of as walls_of,
    )
    from .freeform_surface import FreeformSurface as FreeformSurface
    from .graph_pieces import segment as segment
    from .lens import Lens as Lens
    from .manufacture_bounds import (
        NM_PER_MM as NM_PER_MM,
        HeightRange as HeightRange,
        Manufacturability as Manufacturability,
        SurfaceMetrics as SurfaceMetrics,
        manufacturability as manufacturability,
        mass as mass,
    )
    from .product import (
        Product as Product,
        face_colour as face_colour,
        one_line as one_line,
        optical_places as optical_places,
        require_line as require_line,
    )
    from .rims import (
        CORNERS as CORNERS,
        SIDES as SIDES,
        Corner as Corner,
        OpticalForm as OpticalForm,
        Rim as Rim,
        Side as Side,
        Surfaces as Surfaces,
        above as above,
        edge_names as edge_names,
        optical_forms as optical_forms,
        outline_rims as outline_rims,
        placed_surfaces as placed_surfaces,
        rim as rim,
        rim_indices as rim_indices,
        rim_parameter as rim_parameter,
        rim_pieces as rim_pieces,
        ruled_edge as ruled_edge,
        ruled_edges as ruled_edges,
    )
    from .soundness import require_sound as require_sound, require_sound_graphs as require_sound_graphs
    from .triangulation import (
        ALLOWANCE as ALLOWANCE,
        EDGES as EDGES,
        FRONT as FRONT,
        LEAST_CHORD as LEAST_CHORD,
        MOST_TRIANGLES as MOST_TRIANGLES,
        REAR as REAR,
        Tessellation as Tessellation,
        closed_triangles as closed_triangles,
        require_apart as require_apart,
        subdivided as subdivided,
        tessellated as tessellated,
        walled_triangles as walled_triangles,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
