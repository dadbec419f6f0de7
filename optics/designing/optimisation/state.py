"""What a run needs to go on, and where it starts from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from optics.base.runtime import UserError
from optics.designing.optimisation.indicators import near_cells
from optics.designing.optimisation.stage_plan import Stage, first_level, stages
from optics.scene.limits import feature_levels
from optics.scene.problem import Optic
from optics.scene.system import System
from thbcad.lens import FreeformSurface, Lens
from thbcad.surfaces import THBSurface


@dataclass(frozen=True)
class Row:
    """One evaluation in the history; those that only estimate curvature are counted but have no row.

    stage : index in the plan
    fit : on the rays of the optimiser.
    fresh_fit : on others, where the row is the result of a stage with an extended source.
    """

    level: int
    dof: int
    evaluation: int
    loss: float
    fit: float
    seconds: float
    stage: int
    fresh_fit: float | None = None


@dataclass(frozen=True)
class State:
    """What a run needs to go on.

    started_from_transport : the plan is that of a design that starts from an optimal-transport map.
    stage : index of the next Stage in that plan; the plan's length at the end of a run.
    sags : the surfaces that this stage starts from, in the order of the light.
    """

    started_from_transport: bool
    stage: int
    sags: tuple[THBSurface, ...]
    history: tuple[Row, ...] = ()

    def renumbered(self, system: System, other: System) -> State:
        """Return the state for the plan of a system that differs in its iterations: with few of them no steps
        on fewer cells come first, and their place takes the stage that they prepare; where a run goes on that
        had none of them, they come first."""
        before, after = (stages(s, self.started_from_transport) for s in (system, other))
        earlier, names = [[stage.name for stage in plan] for plan in (before, after)]

        def place(index: int, goes_on: bool = False) -> int:
            if index >= len(before):
                return len(after)
            rough, whole = (replace(before[index], rough=rough).name for rough in (True, False))
            if goes_on and rough in names and rough not in earlier:
                return names.index(rough)
            return names.index(earlier[index] if earlier[index] in names else whole)

        rows = tuple(replace(row, stage=place(row.stage)) for row in self.history)
        return replace(self, stage=place(self.stage, goes_on=True), history=rows)

    def with_steps_left(self, system: System) -> State:
        """Return the state before the steps of the last level, where none are left."""
        plan = stages(system, self.started_from_transport)
        return self if self.stage < len(plan) else replace(self, stage=_of_last_level(plan))

    @property
    def dof(self) -> int:
        """Degrees of freedom of all sags."""
        return sum(sag.space.dim for sag in self.sags)

    @property
    def evaluations(self) -> int:
        return self.history[-1].evaluation if self.history else 0

    @property
    def seconds(self) -> float:
        return self.history[-1].seconds if self.history else 0.0


def first_sags(system: System, from_transport: bool) -> tuple[THBSurface, ...]:
    """Return the sags of a new run: zeros on the meshes of the first level of its plan."""
    first = first_level(system.problem, from_transport)
    pairs = zip(system.unshaped.free_surfaces, feature_levels(system.problem))
    return tuple(_refined(surface, min(first, finest)) for surface, finest in pairs)


def _refined(surface: FreeformSurface, level: int) -> THBSurface:
    """Return the sag of a surface on cells of a level, coarser ones where no light is seen."""
    sag = surface.sag
    assert sag is not None
    if surface.outline.is_rectangle:
        return sag.uniform(level)
    for _ in range(level):
        sag = sag.refine(near_cells(sag.space, surface.outline))
    return sag


def earlier_state(system: System, earlier: Lens, shapes: Mapping[str, Lens] | None = None) -> State:
    """Return the State that optimises the sags of an earlier design on the last level, without a new mesh.

    shapes : of its other free elements by name; one that it lacks starts from zero.

    A surface that was not free in the earlier design starts from zero.  In a mirror-symmetric problem the
    optimiser averages the sags with their mirror images.

    Raises UserError : no surface has a sag, or one lies over another rectangle, conic or mesh.
    """
    if not earlier.sags:
        raise UserError("the earlier design has no freeform surface to start from")
    found = {**(shapes or {}), system.problem.optic.called: earlier}
    sags = [
        sag
        for optic, base in system.unshaped.free_elements
        for sag in _earlier_sags(optic, base, found.get(optic.called, base))
    ]
    return State(False, _of_last_level(stages(system, False)), tuple(sags))


def _of_last_level(plan: Sequence[Stage]) -> int:
    """Return the number of the first stage of the last level."""
    return next(k for k, stage in enumerate(plan) if stage.final)


def _earlier_sags(optic: Optic, lens: Lens, earlier: Lens) -> list[THBSurface]:
    """Return the sags of an earlier shape of an element, zeros where it had none; raise as above."""
    sags = []
    for name in ("front", "rear"):
        base, other = getattr(lens, name), getattr(earlier, name)
        if base.sag is not None:
            sags.append(base.sag if other.sag is None else other.sag)
        same = base.half_width == other.half_width and base.conic == other.conic
        if base.sag is not None and other.sag is not None:
            mesh, others = base.sag.space, other.sag.space
            same = same and (mesh.kv_u, mesh.kv_v) == (others.kv_u, others.kv_v)
        if not same or (base.sag is None and other.sag is not None):
            raise UserError(
                f"the {name} surface of the earlier design differs in half_width, radius, conic, degree or "
                f"spans; make {optic.key(name)} equal to its problem.toml"
            )
    return sags
