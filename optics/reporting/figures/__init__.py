"""Pictures of lenses, scenes and light, drawn by matplotlib."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .canvas import new_figure, png_bytes
    from .command_figures import (
        bound_figure,
        fresnel_figure,
        height_error_figure,
        irradiance_figure,
        made_light_figure,
        phase_space_figure,
        relit_figure,
        two_lights_figure,
    )
    from .intensity_diagrams import intensity_figures
    from .lens_and_light import draw_fan, lens_figures, light_figures
    from .overview import OverviewFigure, level_figure, overview_figure, overview_html
    from .pdf_sheet import sheet_pdf
    from .scene_figure import draw_solid, scene_view, solid_views
    from .tolerance_figures import change_figure, cost_figure, form_figures_of, monte_carlo_figures_of
    from .tool_figures import figures_of_tool

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
