"""A problem made ready: its system with every "auto" resolved, its backend, and its engine."""

from __future__ import annotations

from dataclasses import dataclass
from inspect import signature

from optics.base.runtime import Backend, UserError
from optics.designing.prediction import resolved
from optics.designing.starts import TransportStart, spot_system
from optics.light.blur import aimed_through, spreads_of
from optics.light.engines import BlurredEngine, Engine, ExactEngine
from optics.scene.problem import ENGINES
from optics.scene.system import System

MESHES = ENGINES[-1]


@dataclass(frozen=True, eq=False)
class Prepared:
    """A system, the backend of all but drawn rays, and the transport start where it is known already."""

    system: System
    backend: Backend
    start: TransportStart | None


def prepared(system: System) -> Prepared:
    """Return a system that can be solved, made ready.

    Raises UserError : no usable LLVM library.
    """
    backend = system.design_backend
    system, start = resolved(system, backend)
    return Prepared(system, backend, start)


def require_engine(system: System) -> None:
    """Refuse a problem that its own engine cannot trace, before any work.

    Raises UserError : meshes for what they do not know.
    """
    if system.problem.optimizer.engine == MESHES:
        from optics.exchange.mitsuba import require_meshable  # few designs ask

        require_meshable(system)


def engine_of(
    engine: str | Engine | None, system: System, backend: Backend, of_drawn: Backend | None = None
) -> Engine:
    """Return an engine by its name, or as it is; None is the problem's own.

    of_drawn : as of `ExactEngine`.

    Raises UserError : an unknown name, or an engine that is not installed.
    """
    if engine is None:
        engine = system.problem.optimizer.engine
    if not isinstance(engine, str):
        if not hasattr(engine, "model"):
            raise UserError(f"engine must be a name or have the method model, got {engine!r}")
        if len(signature(engine.model).parameters) != len(signature(ExactEngine.model).parameters) - 1:
            raise UserError("the method model of an engine takes (system, film); the lens is system.designed")
        return engine
    if engine not in ENGINES:
        raise UserError(f"engine must be one of {', '.join(map(repr, ENGINES))}, got {engine!r}")
    if engine == "exact":
        return ExactEngine(backend, of_drawn=of_drawn)
    from optics.exchange.mitsuba import mitsuba_engine  # few designs ask

    return mitsuba_engine(engine, system.problem.run.threads)


def shaping_by(
    engine: str | Engine | None, system: System, backend: Backend, of_drawn: Backend | None = None
) -> tuple[System, Engine]:
    """Return the system whose light a design traces, and the engine that does so.

    Where divergence or roughness blurs the light, that is the sharp system, and the engine blurs its light.
    That of a plate before a plane aims with one lens, and the engine adds up its displaced light.

    Raises UserError : see `engine_of`.
    """
    sharp = system.shaping
    chosen = engine_of(engine, sharp, backend, of_drawn)
    if sharp is system:
        return system, chosen
    spreads = spreads_of(system, spot_system(system, backend).path, backend)
    for spread in reversed(spreads):
        chosen = BlurredEngine(chosen, spread)
    return aimed_through(system, spreads), chosen
