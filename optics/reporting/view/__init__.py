"""What the pictures of an element at work share, and the one that is turned in a browser."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .drawn_rays import scene_paths as scene_paths, stop_rims as stop_rims
    from .glass_camera import lens_sight as lens_sight, photograph as photograph
    from .photo_room import photo_caption as photo_caption
    from .scene_layout import (
        DrawnElement as DrawnElement,
        Scene as Scene,
        block_means as block_means,
        caption as caption,
        drawn_elements as drawn_elements,
        placed as placed,
    )
    from .solid_renderer import (
        Face as Face,
        View as View,
        oblique as oblique,
        outermost as outermost,
        rendered as rendered,
        solid_faces as solid_faces,
        within_foot as within_foot,
    )
    from .viewer_page import scene_page as scene_page

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
