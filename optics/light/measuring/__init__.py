"""Light measured on pixels: rays splatted through windows, cells mapped and cut, half of what is mirrored."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.light.measuring.mapped_cells import MappedCells
    from optics.light.measuring.splat import Splat
    from optics.light.measuring.symmetry import (
        Mirrors,
        light_axes,
        mirror_axes,
        symmetry_axes,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
