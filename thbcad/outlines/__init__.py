"""Curves round a lens in the plane z = 0, what splines hold within, and splines along the rims above them."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from thbcad.outlines.area_quadrature import area_rule as area_rule
    from thbcad.outlines.ellipse import (
        LEAST_SIZE as LEAST_SIZE,
        Ellipse as Ellipse,
        ellipse_integral as ellipse_integral,
    )
    from thbcad.outlines.polygon import Polygon as Polygon, polygon_integral as polygon_integral
    from thbcad.outlines.rim_curves import (
        DEGREE as DEGREE,
        TOLERANCE as TOLERANCE,
        fitted_curve as fitted_curve,
        kinks as kinks,
        rim_curve as rim_curve,
        side_curve as side_curve,
    )
    from thbcad.outlines.rounded_rectangle import RELATIVE as RELATIVE, Outline as Outline

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
