"""Curves round a lens in the plane z = 0, what splines hold within, and splines along the rims above them."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .outline_integrals import UPRIGHT, Shape, area_rule, cross, integral_inside, walled_volume
    from .pieces import LEAST_SIZE, Arc, Line, Path, RimPiece, integral_within
    from .polygon import Polygon
    from .rim_curves import DEGREE, TOLERANCE, fitted_curve, kinks, matched_rims, merged_breaks, rim_curve
    from .rounded_rectangle import RELATIVE, Outline

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
