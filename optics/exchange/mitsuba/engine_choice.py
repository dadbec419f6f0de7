"""The engines of this room by the names that problem files give them."""

from __future__ import annotations

from optics.exchange.mitsuba.camera_engine import CameraEngine
from optics.exchange.mitsuba.loading import load_mitsuba, mitsuba_backend
from optics.exchange.mitsuba.mesh_engine import MeshEngine
from optics.exchange.mitsuba.rendered_model import RenderingEngine
from optics.light.engines import Engine, ExactEngine


def mitsuba_engine(name: str, threads: int = 0) -> Engine:
    """Return the engine of a name; Mitsuba runs in its mono variant.

    name : "mitsuba-exact", whose rays meet the splines themselves; "mitsuba-mesh", whose rays meet meshes;
        "mitsuba-ptracer", whose random light paths end on a screen that a camera sees.
    threads : of all Dr.Jit kernels, 0 for all cores.

    Raises
    ------
    UserError : as `load_mitsuba`.  ValueError : another name.
    """
    mitsuba = load_mitsuba(threads=threads)
    backend = mitsuba_backend(mitsuba)
    if name == "mitsuba-exact":
        return RenderingEngine(ExactEngine(backend))
    if name == "mitsuba-mesh":
        return MeshEngine(mitsuba_backend(mitsuba, "single"))
    if name == "mitsuba-ptracer":
        return CameraEngine(backend)
    raise ValueError(f"there is no engine {name!r} in Mitsuba")
