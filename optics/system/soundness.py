"""Whether a problem can be solved, and what does not suit it, before any tracing."""

from __future__ import annotations

from math import isinf
from typing import TYPE_CHECKING

from optics.problem import limit_advice, require_limits
from optics.system.lens import base_lens, require_place, require_reachable, source_profile, target_light

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from optics.problem import Problem
    from thbcad.lens import Lens

MANY_POLES, STEP_BYTES = 250_000, 76  # poles of a face from where a note is due, and what one takes in a file
CONIC_SLOPE = 2e-9  # about the slope error of a conic's spline that is within 1e-11 mm in height


def sound(problem: Problem) -> tuple[NDArray[np.float64], Lens]:
    """Return the light asked for and the lens before optimisation; UserError where the problem cannot be
    solved."""
    require_limits(problem)
    light, lens = target_light(problem), base_lens(problem)
    source_profile(problem)
    require_place(problem, lens)
    require_reachable(problem, light)
    return light, lens


def advice(problem: Problem, lens: Lens) -> list[str]:
    """Return sentences about settings that do not suit the problem, and limits that the lens misses before
    optimisation."""
    options, sentences = problem.optimizer, []
    if problem.source.kind == "lambertian" and (options.window == "pixel" or options.lost_flux_weight > 1):
        sentences.append(
            'an extended source blurs its light anyway: optimizer.window = "bspline" and lost_flux_weight = '
            "0 suit it better, "
            "and merged pixels save time (examples/extended.toml)"
        )
    bent = any(not isinf(s.radius) and s.conic != -1 for s in (problem.lens.front, problem.lens.rear))
    thrown = CONIC_SLOPE * problem.target.distance
    if bent and not isinf(thrown) and thrown > problem.verify.landing:
        sentences.append(
            "STEP holds conics other than paraboloids as splines, which may move landing points by "
            f"{thrown:.1g} mm at this distance; "
            f"verify.landing = {problem.verify.landing:g} mm may be refused then: use conic = -1, or raise "
            "it if that will do"
        )
    poles = max(graph.coefficients.size for graph in lens.graphs())
    if bent and poles > MANY_POLES:
        sentences.append(
            f"a conic other than a paraboloid needs {poles:,} poles as a spline, about "
            f"{poles * STEP_BYTES / 1e6:.0f} MB of STEP: "
            "conic = -1 needs none of its own, a higher lens.rear.freeform.degree fewer"
        )
    return sentences + limit_advice(problem, lens)
