"""What tools can cut: fit, motion and cusps of balls and noses, and draft for moulds, by geometry alone."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .cusps import Cusps, ball_cusps as ball_cusps, nose_cusps
    from .draft_angles import Draft, draft as draft
    from .spiral_bounds import greatest_acceleration as greatest_acceleration, greatest_slope_along_cut
    from .spiral_motion import (
        Gaps,
        SpiralCut as SpiralCut,
        acceleration_at as acceleration_at,
        highest_rpm as highest_rpm,
        rim_gaps as rim_gaps,
        round_axis,
        tool_acceleration,
    )
    from .tool_fit import (
        SURFACES,
        Fit,
        air_side as air_side,
        ball_fit as ball_fit,
        concavity,
        nose_fit as nose_fit,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
