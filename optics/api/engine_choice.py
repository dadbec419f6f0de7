"""Engines by their names, and what they trace where the light is blurred."""

from __future__ import annotations

from typing import TYPE_CHECKING

from optics.blur import aimed_through, blur_of
from optics.engines import BlurredEngine, ExactEngine
from optics.problem import ENGINES
from optics.runtime import UserError

if TYPE_CHECKING:
    from optics.engines import Engine
    from optics.runtime import Backend
    from optics.system import OpticalSystem


def engine_of(engine: str | Engine | None, system: OpticalSystem, backend: Backend) -> Engine:
    """Return an engine by its name, or as it is; None is the problem's own.

    Raises
    ------
    UserError : an unknown name, or an engine that is not installed.
    """
    if engine is None:
        engine = system.problem.optimizer.engine
    if not isinstance(engine, str):
        if not hasattr(engine, "model"):
            raise UserError(f"engine must be a name or have the method model, got {engine!r}")
        return engine
    if engine not in ENGINES:
        raise UserError(f"engine must be one of {', '.join(map(repr, ENGINES))}, got {engine!r}")
    if engine == "exact":
        return ExactEngine(backend)
    from optics.mitsuba import mitsuba_engine

    return mitsuba_engine(engine, system.problem.run.threads)


def shaping_by(
    engine: str | Engine | None, system: OpticalSystem, backend: Backend
) -> tuple[OpticalSystem, Engine]:
    """Return the system whose light a design traces, and the engine that does so.

    Where divergence or roughness blurs the light, that is the sharp system, and the engine blurs its light.

    Raises
    ------
    UserError : see `engine_of`.
    """
    sharp = system.shaping
    chosen = engine_of(engine, sharp, backend)
    if sharp is system:
        return system, chosen
    blur = blur_of(system, system.path(system.lens), backend)
    return aimed_through(system, blur), BlurredEngine(chosen, blur)
