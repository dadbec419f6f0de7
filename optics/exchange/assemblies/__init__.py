"""Lenses with their mounts, and scenes of elements: exported, and read back or proven against the lens."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .mount_export import export_mounted, mount_from
    from .proof import part_checks, placed_text
    from .scene_export import export_scene, scene_checks, scene_text_check

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
