"""What commands show first."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .check_rows import check_screen
    from .etendue_rows import etendue_screen
    from .screen import Entry, Heading, Screen, full_text, screen_text
    from .tolerance_rows import tolerance_screen
    from .verdict_rows import design_screen, made_screen, road_screen, tool_screen, verify_screen

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
