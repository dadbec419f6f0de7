"""Small pictures of splines and lenses as text: SVG with colour maps, made by numpy alone."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .svg_pictures import card, frame_size, interval_text, line_path, map_element, svg

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
