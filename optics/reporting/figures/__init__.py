"""Pictures of lenses, scenes and light, drawn by matplotlib."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .canvas import new_figure as new_figure, png_bytes as png_bytes
    from .command_figures import (
        bound_figure as bound_figure,
        fresnel_figure as fresnel_figure,
        height_error_figure as height_error_figure,
        irradiance_figure as irradiance_figure,
        made_light_figure as made_light_figure,
        phase_space_figure as phase_space_figure,
        relit_figure as relit_figure,
        two_lights_figure as two_lights_figure,
    )
    from .intensity_diagrams import intensity_figures as intensity_figures
    from .lens_and_light import (
        draw_fan as draw_fan,
        lens_figures as lens_figures,
        light_figures as light_figures,
    )
    from .overview import (
        OverviewFigure as OverviewFigure,
        level_figure as level_figure,
        overview_figure as overview_figure,
        overview_html as overview_html,
    )
    from .scene_figure import draw_solid as draw_solid, scene_view as scene_view, solid_views as solid_views
    from .tolerance_figures import (
        change_figure as change_figure,
        cost_figure as cost_figure,
        form_figures_of as form_figures_of,
        made_lens_figures_of as made_lens_figures_of,
    )
    from .tool_figures import figures_of_tool as figures_of_tool

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
