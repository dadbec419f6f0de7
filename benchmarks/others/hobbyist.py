"""A hobbyist's caustic: a photograph through eight inches of acrylic, in parallel light and in the sun."""

from __future__ import annotations

from pathlib import Path

from benchmarks.designs.design_run import rel_l2_row
from benchmarks.others.case_run import CaseRun, light_rows, run_case, time_rows
from benchmarks.rows.row import Row

SSIM, SECONDS = "SSIM 0.18 to 0.21", "4 to 45 min"
WANTED, ENOUGH = 0.95, 20.0
NEAR = 1.1  # of the one-blur model's rel_l2: what is wanted in the sun
IN_SUN = {"source.divergence_profile": "sun", "optimizer.iterations": [40]}


def hobby_rows(folder: Path, quick: bool) -> list[Row]:
    """Return the rows of the hobbyist's lens, designed for parallel light and shown in the sun."""
    run = run_case("hobby", folder)
    error, _, *rest = light_rows("hobbyist's photograph", run, "", None)
    ssim = Row("  ssim", run.metrics["ssim"], "", SSIM, WANTED, ">=")
    return [error, ssim, *rest, *time_rows(run, SECONDS, ENOUGH), *([] if quick else _in_sun(run, folder))]


def _in_sun(run: CaseRun, folder: Path) -> list[Row]:
    """Return the rows in the sun of the lens for parallel light, and of one for the sun, beside the model.

    The model is the best light of one blur everywhere, that of the lens.
    """
    relit = run.design.relight("sun").metrics
    sunny = run_case("hobby", folder, IN_SUN)
    model = sunny.metrics["rel_l2_one_blur"]
    reference = f"one blur everywhere allows {model:.3f}"
    return [
        rel_l2_row(
            "hobbyist's photograph in the sun, lens for parallel light: rel_l2", relit, reference, None
        ),
        Row("  ssim", relit["ssim"]),
        rel_l2_row(
            "hobbyist's photograph in the sun, lens for it: rel_l2", sunny.metrics, reference, NEAR * model
        ),
        Row("  rel_l2 without noise", sunny.metrics["rel_l2_debiased"]),
        Row("  one-blur model: rel_l2", model),
        Row("  rel_l2 / one-blur model's", sunny.metrics["rel_l2"] / model, "", "", NEAR),
        Row("  ssim", sunny.metrics["ssim"]),
        Row("  efficiency", sunny.metrics["efficiency"]),
        *time_rows(sunny, "", None),
    ]
