"""THB spaces: nested levels and the operators between them."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .domains import MAX_LEVEL as MAX_LEVEL, Cells as Cells
    from .hierarchical_mesh import (
        HierarchicalMesh as HierarchicalMesh,
        common_refinement as common_refinement,
    )
    from .levels import DyadicAxis as DyadicAxis
    from .mesh_picture import mesh_lines as mesh_lines, space_rows as space_rows
    from .multilevel_basis import MultilevelBasis as MultilevelBasis
    from .restriction import intervals as intervals, least_norm as least_norm, whole_cells as whole_cells
    from .thb_space import THBSpace as THBSpace

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
