"""TOML as tables, whose cost is bounded before it is read."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .bounded_tables import MOST_PARTS, toml_tables

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
