"""Optimal transport: maps that carry one density of light into another, and slopes that follow them."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.transport.back_and_forth import transport_map as transport_map
    from optics.transport.fixed_rear import FixedRear as FixedRear
    from optics.transport.poisson import height_from_slopes as height_from_slopes
    from optics.transport.prewarp import prewarped as prewarped
    from optics.transport.shaped_refraction import ShapedFront as ShapedFront, ShapedRear as ShapedRear
    from optics.transport.surface_slopes import refracted as refracted

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
