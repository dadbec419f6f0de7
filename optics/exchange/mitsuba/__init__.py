"""The adapter to Mitsuba 3: meshes, scenes, and the exact tracer as an integrator."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .engines import lens_mesh as lens_mesh, mitsuba_engine as mitsuba_engine
    from .integrator import exact_integrator as exact_integrator, register as register
    from .loading import (
        current_mitsuba as current_mitsuba,
        load_mitsuba as load_mitsuba,
        mitsuba_backend as mitsuba_backend,
    )
    from .mesh import LensMesh as LensMesh
    from .mesh_tracer import MeshTracer as MeshTracer
    from .scene import (
        REFLECTANCE as REFLECTANCE,
        camera_irradiance as camera_irradiance,
        mitsuba_scene as mitsuba_scene,
        scene_dictionary as scene_dictionary,
    )
    from .scene_xml import (
        irradiance_of_one as irradiance_of_one,
        scene_checks as scene_checks,
        scene_file_names as scene_file_names,
        scene_files as scene_files,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
