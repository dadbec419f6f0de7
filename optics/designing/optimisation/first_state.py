"""The state that a run starts from: flat, or with the surface of a transport map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from optics.base.runtime import Backend, NumericalError
from optics.designing.optimisation.level_objective import stage_objective
from optics.designing.optimisation.stage_plan import stages
from optics.designing.optimisation.state import State, first_sags
from optics.designing.starts import StartQuality, TransportFit, TransportStart, start_quality
from optics.light.engines import Engine
from optics.scene.system import System
from thbcad.lens import require_sound
from thbcad.surfaces import THBSurface

INSTEAD = "; the design starts from the base surface instead"
FAR_OFF = "; the design may end far from the target"


@dataclass(frozen=True, eq=False)
class StartChoice:
    """Whether a design starts from the surface of its transport map."""

    system: System
    backend: Backend
    start: TransportStart

    @cached_property
    def first(self) -> TransportFit:
        """The fit on the first mesh."""
        return first_fit(self.system, self.start)

    @property
    def within(self) -> bool:
        """Whether the map's surface is within its bounds, as far as a coarse fit tells."""
        return self.start.traced is None or self.start.within(self.start.traced)

    @property
    def followed(self) -> bool:
        """Whether the first mesh sends most of the light where the map wants it."""
        return self.within and self.start.follows(self.first)

    @cached_property
    def quality(self) -> StartQuality | None:
        """The quality of the start on its first mesh, or, where it is poor there, on the finest that follows
        the map; None where it is not known, and where the first mesh does not follow the map."""
        quality = start_quality(self.system, self.backend, self.first) if self.followed else None
        finest = self.start.finest_fit() if quality and quality.poor else None
        if finest is None or not self.start.follows(finest):
            return quality
        return start_quality(self.system, self.backend, finest)

    @property
    def useless(self) -> bool:
        """Whether the base surface makes light that is nearer to the target."""
        return self.quality is not None and self.quality.useless

    @property
    def doubt(self) -> str:
        """A sentence on what is wrong with a poor start, or ""."""
        return self.quality.sentence(self.start.gap) if self.quality and self.quality.poor else ""


def first_state(
    system: System, start: TransportStart | None, flux: float, engine: Engine
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
        objective = stage_objective(with_sags(system, state.sags), stage, target, engine)
        return objective([sag.coefficients for sag in state.sags]).loss

    return min(cut, flat, key=loss), fit


def transport_start(
    system: System,
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
    choice = StartChoice(system, backend, start)
    if not choice.within:
        note(start.note(choice.first, start.finest_fit()) + INSTEAD)
        return None
    if state is not None or not choice.doubt:
        return start
    note(choice.doubt + (INSTEAD if choice.useless else FAR_OFF))
    return None if choice.useless else start


def _bending_is_limited(system: System) -> bool:
    """Return whether the problem limits curvature, so that a last level needs the surface of the map."""
    limits = system.problem.limits
    return bool(limits.radius or limits.concave_radius)


def first_fit(system: System, start: TransportStart) -> TransportFit:
    """Return the fit on the first mesh of a design, some of whose functions stay in all that follow."""
    return start.fit(first_sags(system, from_transport=True)[-1].space)


def fitted(state: State, start: TransportStart) -> tuple[State, TransportFit]:
    """Return the state with the sag of the transport map on the mesh that it shapes, and the fit."""
    fit = start.fit(state.sags[-1].space)
    return replace(state, sags=(*state.sags[:-1], fit.sag)), fit


def with_sags(system: System, sags: Sequence[THBSurface]) -> System:
    """Return the system with other sags, proven.

    Raises NumericalError : an element cannot exist.
    """
    try:
        return sound_with(system, sags)
    except ValueError as error:
        raise NumericalError(
            f"the optimised lens cannot exist: {error}; lower z_freedom of the free surfaces"
        ) from None


def sound_with(system: System, sags: Sequence[THBSurface]) -> System:
    """Return a system with other sags; raise as `require_sound` of its elements."""
    shaped = system.with_sags(sags)
    elements = shaped.free_elements
    for optic, shape in elements:
        try:
            require_sound(shape)
        except ValueError as error:
            raise ValueError(f"{optic.called}: {error}" if len(elements) > 1 else str(error)) from None
    return shaped
