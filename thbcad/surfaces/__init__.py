"""THB surfaces and their exact conversions."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .thb_surface import STRIP, THBSurface, value_map

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
