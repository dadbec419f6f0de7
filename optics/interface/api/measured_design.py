"""The measured light of a design, with notes on its limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from optics.designing.etendue import bounds_hold, universal_bound
from optics.designing.prediction import (
    blur_limits,
    blur_sentence,
    diffraction_of,
    displaced_limits,
    displaced_sentence,
)
from optics.designing.progress import Notes
from optics.light.analysis import (
    Measurement,
    crosstalk,
    dark_note,
    loss_notes,
    measure,
    passing_share,
    polarisation_note,
    unjudged_note,
)
from optics.scene.system import System


def measured(system: System, notes: Notes) -> Measurement:
    """Return the Measurement of a lens; sentences on blurred and lost light go to the notes."""
    backend = system.backend
    measurement = measure(system, backend)
    metrics = measurement.metrics | passing_share(system.path)
    if system.problem.optic.array is not None:
        metrics |= crosstalk(system, backend)
    if displaced := displaced_limits(system):
        notes(displaced_sentence(displaced, metrics["rel_l2_debiased"]))
    if system.blurred:
        limits = blur_limits(system, backend)
        notes(blur_sentence(system, limits, metrics["rel_l2_debiased"]))
        metrics["rel_l2_one_blur"] = limits.least
    if waves := diffraction_of(system, backend):
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
    """Return a remedy for a dark target.  fates : flux by ray outcome."""
    blocked = sum(flux for name, flux in fates.items() if name.endswith("blocked"))
    if blocked > 0.5 * sum(map(abs, fates.values())):
        return "`thbcad check` names what blocks it: move that out of its way"
    return "raise optimizer.lost_flux_weight, or make the target larger or nearer to the beam"
