"""Tools on a lens: the blur of their cusps in pixels, what was found in words and data."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .blur_of_cusps import (
        CuspBlur as CuspBlur,
        CuspLight as CuspLight,
        LandingResponse as LandingResponse,
        cusp_blur as cusp_blur,
        landing_response as landing_response,
        light_with_cusps as light_with_cusps,
        traced_points as traced_points,
    )
    from .findings import (
        SpiralMotion as SpiralMotion,
        SurfaceFindings as SurfaceFindings,
        ToolFindings as ToolFindings,
        tool_findings as tool_findings,
    )
    from .tool_order import ToolOrder as ToolOrder
    from .tool_words import tool_data as tool_data, tool_lines as tool_lines

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
