"""Pictures of lenses, scenes and light, drawn by matplotlib."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.figures.canvas import (
        new_figure as new_figure,
        new_panels as new_panels,
        plane_figure as plane_figure,
        png_bytes as png_bytes,
    )
    from optics.figures.colours_of_light import colour_figures as colour_figures
    from optics.figures.fresnel_curves import fresnel_figure as fresnel_figure
    from optics.figures.intensity_diagrams import intensity_figures as intensity_figures
    from optics.figures.lens_and_light import (
        draw_fan as draw_fan,
        lens_figures as lens_figures,
        light_figures as light_figures,
    )
    from optics.figures.level_figures import level_figure as level_figure
    from optics.figures.overview import (
        OverviewFigure as OverviewFigure,
        overview_figure as overview_figure,
        overview_html as overview_html,
    )
    from optics.figures.scene_figure import scene_view as scene_view
    from optics.figures.scene_rays import scene_paths as scene_paths
    from optics.figures.solid_figure import draw_solid as draw_solid, solid_views as solid_views
    from optics.figures.source_figures import bound_figure as bound_figure, relit_figure as relit_figure
    from optics.figures.trace_figures import (
        irradiance_figure as irradiance_figure,
        phase_space_figure as phase_space_figure,
        two_lights_figure as two_lights_figure,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
