"""The adapter to Mitsuba 3: meshes, scenes, and the exact tracer as an integrator."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .engines import lens_mesh, mitsuba_engine, require_meshable
    from .integrator import exact_integrator, register as register
    from .loading import current_mitsuba, load_mitsuba as load_mitsuba, mitsuba_backend
    from .mesh import LensMesh
    from .mesh_tracer import MeshTracer
    from .scene import REFLECTANCE, absorbs, camera_irradiance, mitsuba_scene, scene_dictionary
    from .scene_xml import irradiance_of_one, scene_checks, scene_file_names, scene_files

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
