"""The engines of this room by the names that problem files give them."""

from __future__ import annotations

from optics.exchange.mitsuba.loading import load_mitsuba, mitsuba_backend
from optics.exchange.mitsuba.mesh_engine import MeshEngine
from optics.exchange.mitsuba.rendered_model import RenderingEngine
from optics.light.engines import Engine, ExactEngine


def mitsuba_engine(name: str, threads: int = 0) -> Engine:
    """Return the engine of a name; Mitsuba runs in its mono variant.

    name : "mitsuba-exact", whose rays meet the splines themselves; "mitsuba-mesh", whose rays meet meshes.
    threads : of all Dr.Jit kernels, 0 for all cores.

    Raises
    ------
    UserError : as `load_mitsuba`.  ValueError : another name.
    """
    mitsuba = load_mitsuba(threads=threads)
    if name == "mitsuba-exact":
        return RenderingEngine(ExactEngine(mitsuba_backend(mitsuba)))
    if name == "mitsuba-mesh":
        return MeshEngine(mitsuba_backend(mitsuba, "single"))
    raise ValueError(f"there is no engine {name!r} in Mitsuba")
