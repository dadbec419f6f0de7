"""What is known of a designed lens; what it delivers is measured when it is first asked for, and once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from optics.base.runtime import Backend, UserError, device
from optics.designing.etendue import bounds_hold, universal_bound
from optics.designing.optimisation import Row
from optics.designing.prediction import (
    blur_limits,
    blur_sentence,
    diffraction_of,
    displaced_limits,
    displaced_sentence,
)
from optics.designing.progress import Notes
from optics.interface.api.level_records import LevelRecord
from optics.light.analysis import (
    Measurement,
    Verdict,
    crosstalk,
    dark_note,
    delivery_checks,
    judged,
    loss_notes,
    measure,
    passing_share,
    polarisation_note,
    unjudged_note,
)
from optics.scene.limits import limit_checks
from optics.scene.problem import Problem
from optics.scene.system import OpticalSystem, manufactured, other_limit_checks
from thbcad.lens import Lens


@dataclass(frozen=True, eq=False)
class DesignRecord:
    """A lens for a problem.

    problem : with a number for every "auto".  asked : the same as it was asked for.
    history : a row for every evaluation.  notes : sentences on what limits the result.
    wall_s : seconds by phase.  started_from_transport : it began at an optimal-transport map.
    interrupted : Ctrl-C ended the work, and this is the best lens so far.
    levels : of this run, where `run.keep` asks for them.
    """

    asked: Problem
    system: OpticalSystem
    lens: Lens
    history: tuple[Row, ...] = ()
    notes: Notes = field(default_factory=Notes)
    wall_s: Mapping[str, float] = field(default_factory=dict)
    started_from_transport: bool = False
    interrupted: bool = False
    levels: tuple[LevelRecord, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.system, OpticalSystem):
            raise UserError(
                f"a design needs the system of its problem, got {type(self.system).__name__}; "
                "optics.Design.of_lens(problem, lens) makes both of a lens"
            )

    @property
    def problem(self) -> Problem:
        return self.system.problem

    @cached_property
    def measurement(self) -> Measurement:
        """Irradiance, target and metrics, by light that the optimiser has not seen."""
        with device():
            return _measured(self, self.system.backend)

    @property
    def metrics(self) -> dict[str, Any]:
        """Numbers by name, see `optics.light.analysis.measure`, and those of the run."""
        return self.measurement.metrics | self.run_metrics

    @cached_property
    def verdict(self) -> Verdict:
        """What is to be thought of light and lens, by the limits of the problem; the STEP file is not judged.

        `verify` checks that file.
        """
        problem, metrics = self.problem, self.measurement.metrics
        checks = delivery_checks(metrics, problem.verify)
        if problem.limits != type(problem.limits)():
            checks += limit_checks(problem, manufactured(self.system, self.lens))
            checks += other_limit_checks(self.system)
        return judged(metrics, checks, tuple(self.notes), of_file=False)

    @property
    def run_metrics(self) -> dict[str, Any]:
        """Degrees of freedom, levels, evaluations, and the misfit of extended sources on fresh rays."""
        last = self.history[-1].stage if self.history else 0  # its search may not have made the result
        measured = [row for row in self.history if row.fresh_fit is not None and row.stage == last][-1:]
        return {
            "dof": sum(sag.space.dim for sag in self.system.sags(self.lens)),
            "levels": max(sag.space.levels for sag in self.system.sags(self.lens)),
            "evaluations": self.history[-1].evaluation if self.history else 0,
            **({"fit": measured[0].fit, "fresh_fit": measured[0].fresh_fit} if measured else {}),
        }


def _measured(design: DesignRecord, backend: Backend) -> Measurement:
    """Return the Measurement of a lens; sentences on blurred and lost light go to its notes."""
    system, lens, notes = design.system, design.lens, design.notes
    measurement = measure(system, lens, backend)
    metrics = measurement.metrics | passing_share(system.path(lens))
    if system.problem.optic.array is not None:
        metrics |= crosstalk(system, lens, backend)
    if displaced := displaced_limits(system):
        notes(displaced_sentence(displaced, metrics["rel_l2_debiased"]))
    if system.blurred:
        limits = blur_limits(system, lens, backend)
        notes(blur_sentence(system, limits, metrics["rel_l2_debiased"]))
        metrics["rel_l2_one_blur"] = limits.least
    if waves := diffraction_of(system, lens, backend):
        notes(waves.sentence(system.target.unit))
        metrics |= waves.metrics(system.target.unit)
    if bounds_hold(system):
        metrics["rel_l2_by_etendue"] = universal_bound(system).least_rel_l2(metrics["efficiency"])
    unjudged = unjudged_note(metrics, system.problem.verify)
    about_light = [*loss_notes(metrics, system.units), *polarisation_note(metrics), *dark_note(metrics)]
    for sentence in [*about_light, *unjudged]:
        notes(sentence)
    if not metrics["efficiency"]:
        notes(f"no light reaches the target; {_towards_light(metrics[system.units.key('fates')])}")
    return replace(measurement, metrics=metrics)


def _towards_light(fates: Mapping[str, float]) -> str:
    """Return what helps where no light arrives.  fates : the flux of each."""
    blocked = sum(flux for name, flux in fates.items() if name.endswith("blocked"))
    if blocked > 0.5 * sum(map(abs, fates.values())):
        return "`thbcad check` names what blocks it: move that out of its way"
    return "raise optimizer.lost_flux_weight, or make the target larger or nearer to the beam"
