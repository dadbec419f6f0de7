"""The state that a run starts from: flat, or with the surface of a transport map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from optics.base.runtime import Backend, NumericalError
from optics.designing.optimisation.level_objective import stage_objective
from optics.designing.optimisation.stage_plan import stages
from optics.designing.optimisation.state import State, first_sags
from optics.designing.starts import StartQuality, TransportFit, TransportStart, start_quality
from optics.light.engines import Engine
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens, require_sound
from thbcad.surfaces import THBSurface

INSTEAD = "; the design starts from the base surface instead"
FAR_OFF = "; the design may end far from the target"


def first_state(
    system: OpticalSystem, start: TransportStart | None, flux: float, engine: Engine
) -> tuple[State, TransportFit | None]:
    """Return the state of a new run, and the fit of the transport map, if any.

    flux : that the unoptimised lens sends on, W.
    """
    flat = State(False, 0, first_sags(system, False))
    if start is None:
        return flat, None
    moved, fit = fitted(State(True, 0, first_sags(system, True)), start)
    if start.follows(fit):
        return moved, fit
    cut, _ = fitted(flat, start)
    stage = stages(system, False)[0]
    target = system.target.irradiance(stage.screen, flux)

    def loss(state: State) -> float:
        objective = stage_objective(*with_sags(system, state.sags), stage, target, engine)
        return objective([sag.coefficients for sag in state.sags]).loss

    return min(cut, flat, key=loss), fit


def transport_start(
    system: OpticalSystem,
    backend: Backend,
    state: State | None,
    note: Callable[[str], object],
    start: TransportStart | None,
) -> TransportStart | None:
    """Return the start by optimal transport, or None where the run needs none.

    It needs none where the problem asks for a flat start, where the map asks for too much sag, where its
    light is no better than that of the base surface, and where the state to go on from has no level before
    it and the problem does not limit curvature.
    """
    if system.problem.optimizer.start == "flat":
        return None
    if state is not None:
        plan = stages(system, state.started_from_transport)
        over = state.stage >= len(plan) or (
            plan[state.stage].level == plan[-1].level and not _bending_is_limited(system)
        )
        if over or not state.started_from_transport:
            return None
    start = start or TransportStart(system, backend)
    if start.traced is not None and not start.within(start.traced):
        note(start.note(first_fit(system, start), start.finest_fit()) + INSTEAD)
        return None
    quality = first_quality(system, backend, start) if state is None else None
    if quality is None or not quality.poor:
        return start
    note(quality.sentence(start.gap) + (INSTEAD if quality.useless else FAR_OFF))
    return None if quality.useless else start


def _bending_is_limited(system: OpticalSystem) -> bool:
    """Return whether the problem limits curvature, so that a last level needs the surface of the map."""
    limits = system.problem.limits
    return bool(limits.radius or limits.concave_radius)


def first_fit(system: OpticalSystem, start: TransportStart) -> TransportFit:
    """Return the fit on the first mesh of a design, some of whose functions stay in all that follow."""
    return start.fit(first_sags(system, from_transport=True)[-1].space)


def first_quality(system: OpticalSystem, backend: Backend, start: TransportStart) -> StartQuality | None:
    """Return the quality of a start on its first mesh, or, where it is poor there, on the finest.

    None where it is not known, and where z_freedom cuts off so much that the run chooses otherwise.
    """
    fit = first_fit(system, start)
    quality = start_quality(system, backend, fit) if start.follows(fit) else None
    if quality is None or not quality.poor:
        return quality
    return start_quality(system, backend, start.finest_fit())


def fitted(state: State, start: TransportStart) -> tuple[State, TransportFit]:
    """Return the state with the sag of the transport map on the mesh that it shapes, and the fit."""
    fit = start.fit(state.sags[-1].space)
    return replace(state, sags=(*state.sags[:-1], fit.sag)), fit


def with_sags(system: OpticalSystem, sags: Sequence[THBSurface]) -> tuple[OpticalSystem, Lens]:
    """Return the system and its lens with other sags, proven.

    Raises NumericalError : an element cannot exist.
    """
    try:
        return sound_with(system, system.lens, sags)
    except ValueError as error:
        raise NumericalError(
            f"the optimised lens cannot exist: {error}; lower z_freedom of the free surfaces"
        ) from None


def sound_with(system: OpticalSystem, lens: Lens, sags: Sequence[THBSurface]) -> tuple[OpticalSystem, Lens]:
    """Return a system and its lens with other sags; raise as `require_sound` of its elements."""
    system, lens = system.with_sags(lens, sags)
    elements = system.free_elements(lens)
    for optic, shape in elements:
        try:
            require_sound(shape)
        except ValueError as error:
            raise ValueError(f"{optic.called}: {error}" if len(elements) > 1 else str(error)) from None
    return system, lens
