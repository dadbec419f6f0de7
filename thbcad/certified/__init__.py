"""Bounds that hold everywhere, rounding included."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .bernstein_cells import (
        Orders as Orders,
        bernstein as bernstein,
        cell_bounds as cell_bounds,
        tensor_form as tensor_form,
    )
    from .convex_regions import (
        DIRECTIONS as DIRECTIONS,
        ConvexRegion as ConvexRegion,
        Stack as Stack,
        ellipse_supports as ellipse_supports,
        outline_supports as outline_supports,
        rectangle_supports as rectangle_supports,
        region_between as region_between,
        supports_of as supports_of,
    )
    from .extreme_values import (
        Assessment as Assessment,
        Enclosure as Enclosure,
        greatest as greatest,
        minimum as minimum,
        minimum_on_rim as minimum_on_rim,
        reciprocal as reciprocal,
        value_range as value_range,
    )
    from .intervals import (
        MOST_BOXES as MOST_BOXES,
        Interval as Interval,
        positive as positive,
        range_over as range_over,
    )
    from .polynomial_cells import Cells as Cells, corners as corners, rounding as rounding, within as within
    from .slope_and_curvature import greatest_slope as greatest_slope, least_radii as least_radii
    from .spline_distances import distance_bounds as distance_bounds

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
