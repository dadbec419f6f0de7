"""The law of refraction in numpy: slopes that send light where it is wanted, and where light lands."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.light.refraction.rest_of_path import RestOfPath, normalised
    from optics.light.refraction.shaped_surface import ShapedSurface

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
