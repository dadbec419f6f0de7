"""Mounts of lenses: what a mount.toml describes, and the proof that it leaves the clear aperture free."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .clearance import MountProof, require_mount as require_mount
    from .mount_file import mount_of as mount_of, read_mount
    from .records import LEAST, Gate, Hole, Mount, Post

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
