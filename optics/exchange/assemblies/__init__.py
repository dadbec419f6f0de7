"""A lens with its mount: exported, and STEP files of such parts proven against the lens."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .mount_export import export_mounted as export_mounted, mount_from as mount_from
    from .proof import part_checks as part_checks, placed_text as placed_text

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
