"""Tools on a lens: the blur of their cusps in pixels, what was found in words and data."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .blur_of_cusps import (
        CuspBlur,
        CuspLight,
        LandingResponse,
        cusp_blur,
        landing_response,
        light_with_cusps,
        traced_points,
    )
    from .findings import RISE, SpiralMotion, SurfaceFindings, ToolFindings, tool_findings
    from .tool_order import ToolOrder
    from .tool_words import tool_data, tool_lines

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
