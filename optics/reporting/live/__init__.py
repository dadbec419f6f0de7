"""The page that shows a design while it runs."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .live_page import LiveView

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
