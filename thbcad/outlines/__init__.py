"""Curves round a lens in the plane z = 0, what splines hold within, and splines along the rims above them."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .outline_integrals import (
        UPRIGHT as UPRIGHT,
        Shape as Shape,
        area_rule as area_rule,
        cross as cross,
        integral_inside as integral_inside,
        walled_volume as walled_volume,
    )
    from .pieces import (
        LEAST_SIZE as LEAST_SIZE,
        Arc as Arc,
        Line as Line,
        Path as Path,
        RimPiece as RimPiece,
        integral_within as integral_within,
    )
    from .polygon import Polygon as Polygon
    from .rim_curves import (
        DEGREE as DEGREE,
        TOLERANCE as TOLERANCE,
        fitted_curve as fitted_curve,
        kinks as kinks,
        matched_rims as matched_rims,
        merged_breaks as merged_breaks,
        rim_curve as rim_curve,
    )
    from .rounded_rectangle import RELATIVE as RELATIVE, Outline as Outline

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
