"""Ray files: TM-25, Zemax and LightTools, read and written."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.ray_files.formats import ray_bytes, read_rays, require_ray_suffix, write_rays
    from optics.scene.ray_files.ray_set import RaySet

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
