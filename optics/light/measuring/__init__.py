"""Light measured on pixels: rays splatted through windows, cells mapped and cut exactly."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.light.measuring.mapped_cells import MappedCells
    from optics.light.measuring.splat import Splat

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
