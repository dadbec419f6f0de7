"""The runs of study 8: the extended source by the thesis's method, and by the project's own designs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import optics
from benchmarks.checkout import EXAMPLES
from benchmarks.thesis.chapter6.adam_batches import Plan, near_dof
from benchmarks.thesis.chapter6.batch_records import designed, recorded
from benchmarks.thesis.records import Found, Run
from optics.light.analysis import Measurement
from thbcad import Lens

DOF = (25, 49, 70, 253, 637, 2180)  # at the ends of the batches, section 6.3.2
FIRST, FALL = 0.1, 0.5  # step of Adam in the first batch, and its ratio from batch to batch
VERTICES = 450  # in each direction, of Table 6.3
CHECKED = (181, 181)  # 2^15 rays: the second tracer needs seconds for them
NOISE = 0.5  # relative, of the indicators in the control without symmetry
SMALL = 64  # pixels of the quick set
SMALLER = {"rays": (129, 129), "vertices": 226, "iterations": 12}
DESIGNS = {"one free surface": "extended", "two free surfaces": "extended_two"}
LESS = {  # of the effort of the project's own designs, in the quick set
    "optimizer.iterations": [8],
    "optimizer.finish": 0,
    "optimizer.merge": 1,
    "lens.rear.freeform.max_level": 2,
}


def runs(quick: bool) -> list[Run]:
    """Return the runs; the quick ones have fewer batches, steps, pixels and rays."""
    return [*_of_the_thesis(quick), *_own(quick)]


def _of_the_thesis(quick: bool) -> Iterator[Run]:
    plan = Plan(tuple(FIRST * FALL**k for k in range(len(DOF))), near_dof(DOF), vertices=VERTICES)
    pixels, check = 256, CHECKED
    if quick:
        plan, pixels, check = replace(plan, steps=plan.steps[:4], **SMALLER), SMALL, SMALLER["rays"]
    made = partial(recorded, _system(pixels), extra=_fluxes, each=False)
    yield Run("thb", lambda _: made(plan, check=check))
    yield Run("asymmetric", lambda _: made(replace(plan, noise=NOISE), pictures=False))
    yield Run("filtered", lambda _: made(replace(plan, filtered=True), pictures=False))


def _system(pixels: int) -> optics.System:
    problem = optics.load_problem(EXAMPLES / "thesis" / "extended.toml")
    return optics.System(problem.with_(**{"target.pixels": [pixels, pixels]}))


def _own(quick: bool) -> Iterator[Run]:
    """Yield the project's own designs, as its examples have them."""
    for title, name in DESIGNS.items():
        problem = optics.load_problem(EXAMPLES / f"{name}.toml")
        if quick:
            problem = problem.with_(**{"target.pixels": [SMALL, SMALL], **LESS})
            if problem.lens.front.freeform:
                problem = problem.with_(**{"lens.front.freeform.max_level": 2})
        yield Run(title, lambda _, p=problem: designed(p, _fluxes))


def _fluxes(lens: Lens, found: Measurement) -> Found:
    """Return what becomes of the source's 1 W in the closed lens, with all reflections.

    through : flux that leaves forwards, whether by the rear or by an edge.  rear : by the rear alone.
    lit : on the pixels that are to be lit.  back : reflected before the lens, or sent backwards.
    """
    counted = found.metrics["nonsequential"]
    fates = counted["fates_w"]
    rear = fates["on_target"] + fates["off_target"]
    return Found(
        {
            "rear": rear,
            "through": rear + fates["edges_on_target"] + fates["edges_off_target"],
            "lit": counted["lit_w"],
            "back": fates["reflected_outside"] + fates["back"],
            "by_front": fates["front_on_target"] + fates["front_off_target"],
        }
    )
