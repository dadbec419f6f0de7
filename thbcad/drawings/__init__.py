"""Drawings of a lens: views and sections as plane curves with a proven error, dimensions, SVG and DXF."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .curves import Style as Style
    from .drawing_files import (
        DRAWINGS as DRAWINGS,
        drawing_bytes as drawing_bytes,
        write_drawing as write_drawing,
    )
    from .lens_drawing import lens_sheet as lens_sheet
    from .sheets import Sheet as Sheet
    from .views import plan_view as plan_view, section_view as section_view, side_view as side_view

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
