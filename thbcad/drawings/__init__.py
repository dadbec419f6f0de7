"""Drawings of a lens: views and sections as plane curves with a proven error, dimensions, SVG and DXF."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .drawing_files import DRAWINGS, drawing_bytes, write_drawing
    from .lens_drawing import lens_sheet, strokes_of_views
    from .panels import Grid, Panel
    from .sheets import Sheet
    from .svg_sheet import CAPITALS, DASHES, WIDTHS
    from .views import plan_view, section_view, side_view

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
