"""Lenses that other programs wrote: front, rear and frame found by geometry, and refitted."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .foreign_lens import ForeignLens, read_lens_solid

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
