"""Roads under like lamps: illuminance, luminance and glare as EN 13201-3 computes them, and classes."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.light.roads.installation import RANGES, ROWS, Installation
    from optics.light.roads.reflection import read_r_table
    from optics.light.roads.road_classes import CLASSES, road_checks, uniformity

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
