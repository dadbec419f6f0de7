"""What the pictures of an element at work share, and the one that is turned in a browser."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .drawn_rays import scene_paths, stop_rims
    from .glass_camera import elements_sight, photograph
    from .photo_room import MIRRORED, photo_caption
    from .scene_layout import DrawnElement, Scene, block_means, caption, drawn_elements, placed
    from .scene_view import SceneView
    from .solid_renderer import Face, View, oblique, outermost, rendered, solid_faces, within_foot
    from .viewer_page import scene_page

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
