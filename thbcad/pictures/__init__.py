"""Small pictures of splines and lenses as text: SVG with colour maps, made by numpy alone."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .svg_pictures import (
        card as card,
        frame_size as frame_size,
        interval_text as interval_text,
        line_path as line_path,
        map_element as map_element,
        svg as svg,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
