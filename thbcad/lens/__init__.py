"""The closed lens, its rims and edges, and what can be proven of it."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .cuts import (
        Flange as Flange,
        aperture_volume as aperture_volume,
        flanged_volume,
        polygon_volume as polygon_volume,
        require_aperture,
        require_clear,
        require_polygon,
        rim_gap,
        rim_heights,
        walls_of,
    )
    from .dense_sampling import DenseGrid, dense_grid
    from .freeform_surface import FreeformSurface
    from .graph_pieces import segment, steepest
    from .lens import Lens
    from .manufacture_bounds import (
        NM_PER_MM,
        HeightRange,
        Manufacturability,
        SurfaceMetrics,
        manufacturability,
        mass,
        radii_within,
    )
    from .product import (
        LENS_SIDES,
        MIRROR_SIDES,
        Product,
        face_colour,
        one_line,
        optical_places,
        require_line,
    )
    from .rims import (
        CORNERS,
        SIDES,
        Corner,
        OpticalForm,
        Rim,
        Side,
        Surfaces,
        above,
        edge_names,
        optical_forms,
        outline_rims,
        placed_surfaces,
        rim,
        rim_indices,
        rim_parameter,
        rim_pieces,
        ruled_edge,
        ruled_edges,
    )
    from .soundness import require_sound, require_sound_graphs
    from .triangulation import (
        ALLOWANCE,
        EDGES,
        FRONT,
        LEAST_CHORD,
        MOST_TRIANGLES,
        REAR,
        Tessellation,
        closed_triangles,
        subdivided,
        tessellated,
        told_apart,
        walled_triangles,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
