"""THB spaces: nested levels and the operators between them."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .domains import MAX_LEVEL, Cells
    from .hierarchical_mesh import common_refinement
    from .levels import DyadicAxis
    from .mesh_picture import mesh_lines, space_rows
    from .multilevel_basis import MultilevelBasis
    from .restriction import GREATEST_NORM, best_functionals, intervals
    from .thb_space import THBSpace

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
