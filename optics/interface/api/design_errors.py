"""Errors of making a design: one at a time, and all at once in many lenses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from numbers import Real

from optics.base.runtime import UserError, device
from optics.base.workers import require_workers, worker_pool
from optics.interface.api.design_result import Design
from optics.scene.problem import FaceMet
from optics.tolerancing.form_errors import FormErrors, form_errors_of
from optics.tolerancing.monte_carlo_samples import (
    ErrorModel,
    FormTolerance,
    MonteCarlo,
    each_set,
    sample_lenses,
)
from optics.tolerancing.perturbations import RISE, ToleranceBudget, tolerance_budget

SAMPLES = 512
FORM_NM = 50.0  # rms of a free surface: 0.2 to 0.5 um peak to valley are usual for diamond turned plastics
PERIODS = 2.0, 20.0  # mm: shorter ones are roughness, longer ones a wrong power


def _require_design(function: str, design: object) -> None:
    if not isinstance(design, Design):
        raise UserError(f"{function} takes a Design, got {design!r}; Design.load reads a result folder")


def tolerances(
    design: Design,
    amounts: Mapping[str, float] | None = None,
    limit: float | Mapping[str, float] | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    float_shift: bool = False,
) -> ToleranceBudget:
    """Return what each tolerance of elements, source and target does to the light of a design.

    amounts : other amounts than the usual ones, by name, such as {"lens.decentre": 0.02}; 0 leaves one out.
    limit : what the light must keep, for which the amount of each is looked for: a rise of rel_l2 such as
        0.01, or numbers of "rise", "rel_l2", "min_over_mean" and "efficiency"; None is min_over_mean = 0.7 of
        uniform light, and a rise by 0.01 of other light, and efficiency = 0.99 of the design's.
    progress : called with a tolerance's name, its number from 0, and how many there are.
    float_shift : light may shift as a whole on the target, which follows it.

    Raises UserError : an unknown name or a bad amount or limit; one sentence says which.
    """
    _require_design("tolerances", design)
    if amounts is not None and not isinstance(amounts, Mapping):
        raise UserError(f"amounts must be a table such as {{'lens.decentre': 0.02}}, got {amounts!r}")
    with device():
        target = design.measurement.target
        backend = design.system.backend
        return tolerance_budget(design.system, target, backend, amounts, limit, progress, float_shift)


def form_tolerances(
    design: Design, limit: float = RISE, progress: Callable[[str, int, int], None] | None = None
) -> FormErrors:
    """Return what errors of the form of front and rear do to the light of a design, by bands of period.

    limit : rise of rel_l2 for which the rms of each band is looked for.  progress : as of `tolerances`.

    Raises UserError : an extended source or blurred light, or a bad limit; one sentence says which.
    """
    _require_design("form_tolerances", design)
    if isinstance(limit, bool) or not isinstance(limit, Real):
        raise UserError(f"limit must be a rise of rel_l2 such as {RISE:g}, got {limit!r}")
    with device():
        return form_errors_of(design.system, design.system.backend, limit, progress)


def monte_carlo(
    design: Design,
    budget: ToleranceBudget,
    samples: int = SAMPLES,
    forms: Mapping[str, float] | None = None,
    periods: tuple[float, float] = PERIODS,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> MonteCarlo:
    """Return what becomes of many lenses of a design, each with all of its errors at once, traced exactly.

    budget : of `tolerances`, whose amounts and limit hold here too.
    samples : lenses, 8 times a power of two.
    forms : rms of the form of "front" and "rear" in nm, in a row of elements of "L1.rear" or "M1.face"; of a
        free surface that is left out it is FORM_NM.
    periods : shortest and longest period of the form errors, mm.
    workers, scheduler : see `optics.base.workers.worker_pool`.
    progress : called with the number of lenses that are done, and of all.

    Raises UserError : bad numbers, or no workers.
    """
    _require_design("monte_carlo", design)
    if not isinstance(budget, ToleranceBudget):
        raise UserError(f"monte_carlo takes the budget that tolerances returns, got {budget!r}")
    each_set(samples)  # refuses it before any worker starts
    model = ErrorModel(
        design.system,
        design.measurement.target,
        tuple(effect.tolerance for effect in budget.effects),
        _forms(design, forms, periods),
        budget.floats,
    )
    with device(), worker_pool(workers, scheduler, samples) as pool:
        sampled = sample_lenses(model, samples, pool, progress)
    return MonteCarlo(sampled, model, budget)


def require_monte_carlo(
    design: Design,
    samples: int = SAMPLES,
    forms: Mapping[str, float] | None = None,
    periods: tuple[float, float] = PERIODS,
    workers: int | None = None,
    scheduler: str | None = None,
) -> None:
    """Raise UserError where `monte_carlo` would refuse these arguments, before any work is done."""
    _require_design("monte_carlo", design)
    each_set(samples)
    require_workers(workers, scheduler)
    if scheduler is not None:
        with worker_pool(scheduler=scheduler):
            pass  # it answers
    for form in _forms(design, forms, periods):
        form.drawn(design.system, seed=0)


def _forms(
    design: Design, forms: Mapping[str, float] | None, periods: tuple[float, float]
) -> tuple[FormTolerance, ...]:
    """Return the form tolerances of the surfaces, those of 0 left out."""
    free = (FaceMet(optic, face).name for optic in design.problem.free_optics for face in optic.free)
    chosen = dict.fromkeys(free, FORM_NM) | dict(forms or {})
    try:
        found = [FormTolerance(name, rms / 1e6, periods) for name, rms in chosen.items()]
    except TypeError:
        raise UserError(f"a form error must be a number in nm, got {chosen}") from None
    return tuple(form for form in found if form.rms)
