"""The plan of a design: levels with their pixels and rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil

from optics.base.runtime import UserError
from optics.scene.problem import Problem, per_level
from optics.scene.receivers import Screen
from optics.scene.system import System, freeforms

PROBES = 8  # evaluations that estimate the diagonal of the Gauss-Newton Hessian
MOST_RAYS = 40_000_000  # at once
MARGIN = 8  # dark pixels around the target
PIXELS_PER_SPAN = 4  # a level's pixels are merged while this many remain per knot span
# cells of the source in each direction, per pixel and per knot span that is lit: with fewer the optimiser
# fits the corners and not the light between them
CELLS_PER_PIXEL = 3.0
CELLS_PER_SPAN = 3.6
# parts of pixels to a span that is lit, where it is narrower than a pixel: else light is grainy within
# pixels, whose means alone are asked for (exp(-2 r^2) + 0.1 on 64 x 64 pixels, 192 spans: rel_l2 is 0.0001,
# and 0.020 of the same lens on pixels a quarter as wide; with parts 0.0001 and 0.0004)
PARTS_PER_SPAN = 4 / 3
# and at least, of light that is known everywhere, as that of pictures is not: else its border lies anywhere
# within the outermost pixels (a ramp by 24 spans on 64 pixels: 0.0035, and 0.137 of the same lens on pixels a
# quarter as wide; with two parts 0.0053 and 0.040)
OF_FORMULAS = 2
# of a pixel, and of all in a direction, in each direction: those of strips would fill the memory
MOST_PARTS, MOST_OF_ALL = 6, 2048
# steps of a stage from which on the first are taken on fewer cells; one of LATE of them is not; and the cells
# of the others in each direction (a third of the steps and 0.55 of the cells took 1.03 to 1.35 times the
# seconds of nine examples, and left seven of them more rel_l2; with 60 steps on level 6 both are alike)
MANY_STEPS, LATE, FEWER = 24, 2, 0.4
# seconds of an evaluation, and of a stage without any, as measured on the examples for two quiet cores
PER_EVALUATION, PER_RAY, PER_DOF = 0.006, 3.3e-8, 5e-7
MARKING_PER_RAY = 2.2e-7
# stages before a finish that see light by other ways, which follows their shape (extended.toml: rel_l2 0.187
# to 0.189 of five seeds with two, 0.189 and 0.195 of two seeds with one, 0.187 and 0.193 with four)
SEEING = 2
BACKGROUND = 2.0  # of a stage that measures the light by other ways
# of a finish's steps, after light by other ways was seen again, which follows the rear but no edges.  Of 140
# steps in one piece rel_l2 was 0.210, with a quarter behind another look 0.188, with half 0.193
# (extended.toml); of 40 with a free front too 0.1196 and 0.1132 (extended_two.toml, seed 1; in three or four
# pieces 0.1138, 0.1133)
SEEN_AGAIN = 0.25


@dataclass(frozen=True, eq=False)
class Stage:
    """Pixels and rays of one level.

    rays : in x and y; the corners of cells where the stage is exact.
    parts : of every pixel in each direction, that are the pixels of its screen.
    final : the last one, with the window of the problem; all others take wide windows, which move light over
        long distances.
    exact : the light of cells on the pixels themselves, not that of rays in a window.
    finish : with the rays of unmerged pixels, and a narrower window.
    again : the last piece of a finish, behind another look at light by other ways.
    aimed : the sharp light is compared with the system's aim, before blurred light is with the target.
    far_sighted : by a norm that moves light over long distances, before the same level in that of the pixels.
    rough : on fewer cells, before the same level on as many as its mesh needs.
    other_ways : light by these is part of its light: in a finish, and on the last levels before one where it
        is not exact.
    """

    level: int
    iterations: int
    screen: Screen
    rays: tuple[int, int]
    final: bool
    exact: bool
    finish: bool = False
    again: bool = False
    aimed: bool = False
    rough: bool = False
    far_sighted: bool = False
    other_ways: bool = False
    parts: int = 1

    @property
    def pixels(self) -> list[int]:
        """Columns and rows of its pixels, which may have parts."""
        return [n // self.parts for n in self.screen.pixels]

    @property
    def name(self) -> str:
        """In a word or three."""
        if self.finish:
            return "finish again" if self.again else "finish"
        kind = "sharp " * self.aimed + "rough " * self.rough + "far-sighted " * self.far_sighted
        return f"{kind}level {self.level}"

    @property
    def roughly(self) -> Stage:
        """The stage on fewer cells: that will do for steps that others follow, and for the scale of its
        variables."""
        if not (self.exact and self.final) or self.rough:
            return self
        return replace(self, rays=_fewer(self), rough=True)

    @property
    def evaluations(self) -> int:
        """Expected evaluations of loss and gradient, with those that estimate curvature."""
        return self.iterations + 1 + PROBES

    def seconds(self, dof: float) -> float:
        """Return the expected seconds, on a machine with two quiet cores, with this many degrees of freedom.

        Only the ratios of stages and other phases count: the machine's own speed turns out in the run.
        """
        rays = self.rays[0] * self.rays[1]
        if not self.iterations:
            return MARKING_PER_RAY * rays
        return self.before + stage_seconds(self.iterations, rays, dof)

    @property
    def before(self) -> float:
        """The expected seconds before the first evaluation."""
        return BACKGROUND if self.other_ways else 0.0


def stage_seconds(iterations: int, rays: float, dof: float) -> float:
    """Return the expected seconds of the evaluations of a stage, see `Stage.seconds`.

    Those that estimate curvature take half: their light is the same.
    """
    return (iterations + 1 + PROBES / 2) * (PER_EVALUATION + PER_RAY * rays + PER_DOF * dof)


def first_level(problem: Problem, from_transport: bool) -> int:
    """Return the level at which optimisation starts.

    A transport start makes the levels superfluous whose spans are wider than four pixels.
    """
    last = last_level(problem)
    if not from_transport:
        return 0
    fine = [level for level in range(last + 1) if _coarsening(problem, level) == problem.optimizer.merge]
    return fine[0] if fine else last


def last_level(problem: Problem) -> int:
    """Return the level at which the run ends."""
    return max(f.finest for f in freeforms(problem))


def stages(system: System, from_transport: bool) -> list[Stage]:
    """Return the Stage of every level that is optimised.

    A blurred system that starts from transport optimises its sharp light before its blurred light: the loss
    of blurred light alone falls slowly, since it hardly sees single pixels.

    from_transport : the design starts from an optimal-transport map
    """
    system = system.shaping
    problem = system.problem
    last = last_level(problem)
    out = []
    for level in range(first_level(problem, from_transport), last + 1):
        iterations = 0 if from_transport and level < last else per_level(problem.optimizer.iterations, level)
        out.append(_stage(system, level, iterations, _coarsening(problem, level), level == last))
    if from_transport and system.aim:
        screen, final = system.aim.screen(margin=MARGIN), out[-1]
        aimed = replace(final, screen=screen, rays=_fewer(final), final=False, aimed=True, parts=1)
        out[-1:] = [aimed, *_roughly_first(final)]
    elif system.source.several:
        out.insert(-1, replace(out[-1], final=False, far_sighted=True))
    elif from_transport:
        out[-1:] = _roughly_first(out[-1])
    return [*_seeing_other_ways(out), *_finish(system, last)] if problem.optimizer.finish else out


def _seeing_other_ways(plan: Sequence[Stage]) -> list[Stage]:
    """Return the stages before a finish, of which the last ones see light by other ways where they can."""

    def sees(stage: Stage) -> bool:
        return stage.iterations > 0 and not (stage.exact or stage.aimed or stage.far_sighted)

    return [*plan[:-SEEING], *(replace(stage, other_ways=sees(stage)) for stage in plan[-SEEING:])]


def _finish(system: System, level: int) -> list[Stage]:
    """Return the last pass: as many rays as unmerged pixels ask for, on merged ones where light is not exact.

    Merged pixels average the noise of rays, which an optimiser fits.  It has two pieces where light by
    other ways counts that is not measured in cells.
    """
    options = system.problem.optimizer
    stage = _stage(system, level, options.finish, 1, True)
    screen = stage.screen if stage.exact else system.target.screen(options.merge, MARGIN)
    finish = replace(stage, screen=screen, finish=True, other_ways=True)
    late = round(SEEN_AGAIN * options.finish) if system.by_edges and not stage.exact else 0
    if not late:
        return [finish]
    return [replace(finish, iterations=options.finish - late), replace(finish, iterations=late, again=True)]


def _stage(system: System, level: int, iterations: int, coarsening: int, final: bool) -> Stage:
    problem, screen = system.problem, system.target.screen(coarsening, MARGIN)
    exact = final and problem.optimizer.window == "cells" and not system.source.extended
    parts = 1
    if exact:
        counts, parts = _cells(system, level, screen), _parts(system, level) if coarsening == 1 else 1
        screen = system.target.screen(coarsening, MARGIN, parts)
    else:
        per_pixel, spans = problem.optimizer.rays_per_pixel, _spans(problem, level)
        counts = [max(64, ceil(per_pixel * n), 2 * s) for n, s in zip(screen.pixels, spans)]
    rays_x, rays_y = (n + 1 for n in counts)
    if rays_x * rays_y > MOST_RAYS:
        raise UserError(
            f"level {level} would trace {rays_x} x {rays_y} rays at once, too many for the memory of most "
            "machines; use fewer target.pixels, freeform.spans or levels, or fewer optimizer.rays_per_pixel"
        )
    return Stage(level, iterations, screen, (rays_x, rays_y), final, exact, parts=parts)


def _roughly_first(stage: Stage) -> list[Stage]:
    """Return the stages in place of one: its first steps on fewer cells, where its steps are enough for two
    searches."""
    if not stage.exact or stage.iterations < MANY_STEPS:
        return [stage]
    late = stage.iterations // LATE
    rough = replace(stage.roughly, iterations=stage.iterations - late)
    return [rough, replace(stage, iterations=late)]


def _fewer(stage: Stage) -> tuple[int, int]:
    """Return the rays of a stage on fewer cells, where it is exact."""
    rays_x, rays_y = (_even(FEWER * (n - 1)) + 1 if stage.exact else n for n in stage.rays)
    return rays_x, rays_y


def _cells(system: System, level: int, screen: Screen) -> list[int]:
    spans = _lit_spans(system, level)
    counts = [_even(max(CELLS_PER_PIXEL * n, CELLS_PER_SPAN * s)) for n, s in zip(screen.pixels, spans)]
    return [max(counts)] * 2 if system.source.kinked else counts  # which has as many both ways


def _parts(system: System, level: int) -> int:
    """Return the parts of a pixel in each direction: 1 where light is blurred or displaced, of zones, and of
    pictures where the spans of a level are as wide as pixels."""
    target = system.target.settings
    if system.aim or target.kind == "zones":
        return 1
    finest = max(s / n for s, n in zip(_lit_spans(system, level), target.pixels))
    least = 1 if target.kind == "image" else OF_FORMULAS
    wanted = max(2, round(PARTS_PER_SPAN * finest)) if finest > 1 else least
    return max(1, min(wanted, MOST_PARTS, MOST_OF_ALL // max(target.pixels)))


def _lit_spans(system: System, level: int) -> list[float]:
    """Return the knot spans in x and y that light meets, of the finest free surface on a level."""
    half_width, spans = getattr(system.base, system.shaped).half_width, _spans(system.problem, level)
    size = system.problem.source.half_width if system.shapes_parallel else half_width
    return [n * min(1.0, s / h) for n, s, h in zip(spans, size, half_width)]


def _even(count: float) -> int:
    """Return an even number of cells, of which one half may do, and not too few."""
    return 2 * ceil(max(64, count) / 2)


def _spans(problem: Problem, level: int) -> list[int]:
    """Return the knot spans in x and y of the finest free surface on a level."""
    return [
        max(n << min(level, f.finest) for n, f in zip(row, freeforms(problem)))
        for row in zip(*(f.spans for f in freeforms(problem)))
    ]


def _coarsening(problem: Problem, level: int) -> int:
    """Return how many pixels a level merges in each direction: optimizer.merge times a power of 2."""
    spans = _spans(problem, level)
    coarsening = problem.optimizer.merge
    while all(n // (2 * coarsening) >= PIXELS_PER_SPAN * s for n, s in zip(problem.target.pixels, spans)):
        coarsening *= 2
    return coarsening
