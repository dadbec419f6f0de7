"""Pictures of tolerances, form errors, tools and made lenses, drawn by matplotlib."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.making_figures.as_built_figures import (
        height_error_figure as height_error_figure,
        made_light_figure as made_light_figure,
    )
    from optics.making_figures.form_figures import form_figures_of as form_figures_of
    from optics.making_figures.made_lens_figures import made_lens_figures_of as made_lens_figures_of
    from optics.making_figures.tolerance_figures import (
        change_figure as change_figure,
        cost_figure as cost_figure,
    )
    from optics.making_figures.tool_figures import figures_of_tool as figures_of_tool

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
