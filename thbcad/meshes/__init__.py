"""Triangle meshes of lenses, apertures, polygons, flanges and parts; hand-over to trimesh, and GLB files."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .bodies import body_mesh
    from .glb_file import glb_bytes
    from .trimesh_objects import to_trimesh

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
