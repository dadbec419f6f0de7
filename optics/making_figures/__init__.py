"""Pictures of tolerances, form errors, tools and made lenses, drawn by matplotlib."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.making_figures.as_built_figures import (
        height_error_figure as height_error_figure,
        made_light_figure as made_light_figure,
    )

_FILES = {
    "as_built_figures": (
        "height_error_figure",
        "made_light_figure",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
