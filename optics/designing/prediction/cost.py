"""Seconds and memory that a design will take, from its plan alone.

    seconds = START + RAY * rays of all evaluations + FUNCTION * functions of the finest mesh

RAY depends on how rays meet the rear.  Transport maps of rays that are traced, and blurred light, take their
time too.  START, RAY and FUNCTION were fitted to stored designs on two cores.
"""

from __future__ import annotations

from collections.abc import Sequence

from optics.designing.optimisation import Stage, last_level
from optics.light.measuring import symmetry_axes
from optics.scene.system import System

# fitted to pictures of docs/data/untuned.json and to the designs of overview.json: 0.80 to 0.96 times these
START = 3.4  # s, for start, STEP file, measurement, checks and figures
RAY = 0.085e-6  # s per ray and evaluation, where parallel rays meet the rear at known positions
FUNCTION = 28.0e-6  # s per function of the finest mesh, in files and checks
MAPPED = 6.0  # s more for a transport map of rays that are not parallel where they are shaped
BLURRED = 1.8  # s more where light is blurred, or displaced
IN_PLATE = 1.2  # s more for each lens of a plate, through which the crosstalk is traced
SEARCHED, BOTH_FREE = 2.33, 2.95  # times RAY, where rays are searched for; through two free surfaces
DRAWN = 0.55  # times that, in single precision
# the peaks of overview.json and of the twenty pictures within 1.2 times
BASE_MB = 890.0
BYTES = 250  # per ray
CELL_BYTES = 2000  # the same for cells whose rays are searched for


def seconds_and_memory(system: System, plan: Sequence[Stage]) -> tuple[float, float]:
    """Return the seconds of a design on two cores, from the start of the process to the verified result, and
    the peak memory of it and its helper processes, MB."""
    rays = _rays(system, plan)
    work = sum(s.evaluations * n for s, n in rays)
    kind = 1.0 if system.parallel else SEARCHED
    if len(system.freeforms) > 1:
        kind = BOTH_FREE
    if system.source.extended and system.problem.run.precision != "double":
        kind *= DRAWN
    functions = 1
    for axis in (0, 1):
        functions *= max(f.spans[axis] << min(f.finest, last_level(system.problem)) for f in system.freeforms)
    more = (MAPPED if system.by_edges else 0.0) + (BLURRED if system.blurred or system.displaced else 0.0)
    if system.problem.optic.array is not None:
        more += IN_PLATE * system.problem.optic.array.count
    held = (n * (CELL_BYTES if s.exact and not system.parallel else BYTES) for s, n in rays)
    memory = BASE_MB + max(held, default=0.0) / 1e6
    return START + more + RAY * kind * work + FUNCTION * functions, memory


def _rays(system: System, plan: Sequence[Stage]) -> list[tuple[Stage, float]]:
    """Return the stages that optimise, and the rays that one evaluation traces: a mirror image needs none."""
    halves = 2 ** len(symmetry_axes(system))
    return [
        (stage, stage.rays[0] * stage.rays[1] / (halves if stage.exact or system.source.extended else 1))
        for stage in plan
        if stage.iterations
    ]
