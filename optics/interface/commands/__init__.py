"""What the command line does."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .arguments import parsers
    from .cli import main

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
