"""Pictures of tolerances, form errors, tools and made lenses, drawn by matplotlib."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.making_figures.tool_figures import (
        figures_of_tool as figures_of_tool,
    )

_FILES = {
    "tool_figures": ("figures_of_tool",),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
