"""A hobbyist's caustic: a photograph through eight inches of acrylic, in parallel light and in the sun."""

from __future__ import annotations

from pathlib import Path

from benchmarks.others.case_run import CaseRun, light_rows, run_case, time_rows
from optics.etendue import one_blur
from optics.runtime import Row
from optics.system import OpticalSystem

SSIM, SECONDS = "SSIM 0.18 to 0.21", "4 to 45 min"
WANTED, ENOUGH = 0.95, 20.0
NEAR = 1.1  # of the one-blur model's rel_l2: what is wanted in the sun
SUN = {"source.divergence_profile": "sun"}


def hobby_rows(folder: Path, quick: bool) -> list[Row]:
    """Return the rows of the hobbyist's lens, designed for parallel light and shown in the sun."""
    run = run_case("hobby", folder)
    error, _, *rest = light_rows("hobbyist's photograph", run, "", None)
    ssim = Row("  ssim", run.metrics["ssim"], "", SSIM, WANTED, ">=")
    return [error, ssim, *rest, *time_rows(run, SECONDS, ENOUGH), *([] if quick else _in_sun(run))]


def _in_sun(run: CaseRun) -> list[Row]:
    """Return the rows of the lens in the sun, beside the model that has one blur everywhere."""
    problem, lens = run.design.problem, run.design.lens
    lit = run.design.relight("sun").metrics
    system = OpticalSystem(problem.with_(**SUN))
    images = one_blur(system, lens, lit["efficiency"], any_form=False)
    model = images.bound.attained
    return [
        Row(
            "hobbyist's photograph in the sun: rel_l2",
            lit["rel_l2"],
            "",
            f"one blur everywhere attains {model:.3f}",
            NEAR * model,
            quantity="irradiance, box pixels, unit mean",
            estimator=lit["estimator"],
            error=lit["rel_l2_floor"],
        ),
        Row("  one-blur model: rel_l2 attained", model),
        Row("  one-blur model: lower bound", images.bound.lower_bound),
        Row("  ssim", lit["ssim"]),
    ]
