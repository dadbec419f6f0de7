"""The law of refraction in numpy: slopes that send light where it is wanted, and where light lands."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.light.refraction.fixed_rear import FixedRear as FixedRear
    from optics.light.refraction.shaped_refraction import ShapedFront as ShapedFront, ShapedRear as ShapedRear
    from optics.light.refraction.surface_slopes import refracted as refracted

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
