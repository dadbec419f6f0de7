"""Bounds that hold everywhere, rounding included."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .bernstein_cells import Orders, bernstein, cell_bounds, tensor_form
    from .convex_regions import (
        DIRECTIONS,
        ConvexRegion,
        Stack,
        ellipse_supports,
        outline_supports,
        rectangle_supports,
        region_between,
        supports_of,
    )
    from .extreme_values import (
        Assessment,
        Enclosure,
        greatest,
        minimum,
        minimum_on_rim,
        reciprocal,
        value_range,
    )
    from .intervals import MOST_BOXES, Interval, positive, range_over
    from .polynomial_cells import Cells, corners, rounding, within
    from .slope_and_curvature import greatest_slope, least_radii
    from .spline_distances import distance_bounds

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
