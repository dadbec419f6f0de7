"""What every skip of `optics.system` saves, and what it changes: loss and gradient with and without it.

Run: thbcad bench skips

Every variant without a skip is built here; one thread, medians.  Limits are the tolerances that `skips`
states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.util import find_spec
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import EXAMPLES
from optics.optimisation import MARGIN, Objective
from optics.problem import Problem, load_problem
from optics.runtime import Backend, DrArray, Row, load_backend, median_seconds
from optics.sources import Beam, beam_rays, collimated_beam
from optics.system import base_lens, problem_rays, skips, target_irradiance, target_light, target_screen
from optics.target import BSplineWindow, GaussianWindow, PixelWindow
from optics.tracing import SourceRays, TargetPlane, Tracer, trace_nonsequential
from thbcad import Lens, THBSurface

COUNT, REPEATS = 449, 9
WINDOW = BSplineWindow(3)
FAR_CUT = 8.0  # sigma, where a Gaussian is 1e-14
SPP = 4

Gradients = list[NDArray[np.float64]]
Evaluation = Callable[[], tuple[float, Gradients]]


class FrontAgain(Tracer):
    """A Tracer that traces the frozen front in every evaluation."""

    def _meet(self, coefficients: Sequence[NDArray[np.float64]]) -> Any:
        _, self._behind = self._through_front(None)
        self._backend.dr.eval(self._behind.origin, self._behind.direction, self._behind.flux)
        return super()._meet(coefficients)


class Literals:
    """Dr.Jit with numbers that become constants of the kernels."""

    def __init__(self, dr: Any) -> None:
        self._dr = dr

    def __getattr__(self, name: str) -> Any:
        return getattr(self._dr, name)

    def opaque(self, kind: type[DrArray], value: float) -> DrArray:
        return kind(value)


def rows() -> list[Row]:
    """Return the figures."""
    backend = load_backend("double", 1)
    pearl, extended = (_deep(load_problem(EXAMPLES / f"{name}.toml")) for name in ("pearl", "extended"))
    return [
        *_meeting_points(backend, *pearl),
        *_aperture(backend, *pearl),
        *_edges(backend, *pearl),
        *_levels(backend, pearl[0]),
        *_taps(backend, *pearl),
        *_front(backend, *extended),
        *_gradients(backend, *extended),
        *_converged(backend, *extended),
        *_first_meetings(backend, *extended),
        *_compilation(backend, *extended),
        *_camera(backend, *pearl),
    ]


def _deep(problem: Problem, levels: int = 4, share: float = 1.0) -> tuple[Problem, Lens]:
    """Return the problem and its lens with a rough sag; share : of the width whose cells are refined, from
    one corner."""
    lens, rng = base_lens(problem), np.random.default_rng(1)
    sag = lens.rear.sag
    for level in range(levels):
        cells = sag.space.cells
        limit = share * np.array([sag.space.kv_u.spans, sag.space.kv_v.spans]) * 2**level
        sag = sag.refine({level: cells[(cells[:, 0] == level) & (cells[:, 1:] < limit).all(axis=1), 1:]})
    height = 1e-4 * max(lens.rear.half_width)
    return problem, lens.with_sags([THBSurface(sag.space, rng.uniform(-height, height, sag.space.dim))])


def _objective(
    backend: Backend,
    problem: Problem,
    tracer: Tracer,
    window: PixelWindow | BSplineWindow | GaussianWindow = WINDOW,
) -> Objective:
    screen = target_screen(problem, problem.optimizer.merge, MARGIN)
    target = target_irradiance(target_light(problem), screen, problem.target.placing, problem.source.flux)
    return Objective(backend, tracer, screen, window, target, problem.optimizer.lost_flux_weight)


def _evaluation(backend: Backend, problem: Problem, lens: Lens, tracer: Tracer) -> Evaluation:
    """Return a function without arguments that takes loss and gradient."""
    objective = _objective(backend, problem, tracer)
    return lambda: objective([sag.coefficients for sag in lens.sags])


def _pair(problem: Problem, name: str, with_skip: Evaluation, without: Evaluation) -> list[Row]:
    """Return times of both variants and the relative difference of the results."""
    (skip,) = [s for s in skips(problem) if s.name == name]
    (loss, gradients), (other_loss, other_gradients) = with_skip(), without()
    g, other = np.concatenate(gradients), np.concatenate(other_gradients)
    difference = max(
        abs(loss - other_loss) / abs(other_loss), float(np.linalg.norm(g - other) / np.linalg.norm(other))
    )
    return _timed(
        name, median_seconds(with_skip, REPEATS), median_seconds(without, REPEATS), difference, skip.tolerance
    )


def _timed(name: str, fast: float, slow: float, difference: float, limit: float | None) -> list[Row]:
    return [
        Row(f"{name}: skipped", fast, "s"),
        Row(f"{name}: not skipped", slow, "s", f"{slow / fast:.2f} times"),
        Row(f"{name}: relative difference of the results", difference, "", "", limit),
    ]


def _meeting_points(backend: Backend, problem: Problem, lens: Lens) -> list[Row]:
    beam = problem_rays(problem, (COUNT, COUNT))
    tracers = (Tracer(backend, lens, rays, problem.target_z) for rays in (beam, beam_rays(beam, lens)))
    return _pair(
        problem, "meeting points", *(_evaluation(backend, problem, lens, tracer) for tracer in tracers)
    )


def _aperture(backend: Backend, problem: Problem, lens: Lens) -> list[Row]:
    """A beam 1.5 times as wide as the lens, on one grid."""
    half = lens.front.half_width
    beam = collimated_beam([1.5 * h for h in half], problem.source.flux, half, (300, 300))
    x, y = ((np.arange(450) - 224.5) * (2 * h / 300) for h in half)
    whole = Beam(x, y, beam.ray_flux, 0.0)
    return _pair(
        problem,
        "aperture",
        *(
            _evaluation(backend, problem, lens, Tracer(backend, lens, b, problem.target_z))
            for b in (beam, whole)
        ),
    )


def _edges(backend: Backend, problem: Problem, lens: Lens) -> list[Row]:
    """Light forward only; the closed lens has no gradient."""
    beam = problem_rays(problem, (129, 129))
    rays, c = beam_rays(beam, lens), [sag.coefficients for sag in lens.sags]
    tracer, half = Tracer(backend, lens, beam, problem.target_z), problem.target.half_width
    everything = SourceRays(rays.origin, rays.direction, np.full(rays.origin.shape[1], rays.ray_flux))
    plane = TargetPlane(problem.target_z, half)
    found = trace_nonsequential(backend, lens, everything, plane).landings
    onto = (abs(found.x) <= half[0]) & (abs(found.y) <= half[1])
    direct = found.flux[onto & found.direct].sum()

    def sequential() -> float:
        return tracer.budget(tracer.trace(c)[1], half).on_target

    (skip,) = [s for s in skips(problem) if s.name == "edges"]
    fast, slow = (
        median_seconds(sequential, REPEATS),
        median_seconds(lambda: trace_nonsequential(backend, lens, everything, plane), 3),
    )
    other = Row("edges: light on the target by other ways, share", float(1 - direct / found.flux[onto].sum()))
    return [*_timed("edges", fast, slow, abs(sequential() / direct - 1), skip.tolerance), other]


def _levels(backend: Backend, problem: Problem) -> list[Row]:
    """Cells of a quarter of the width refined four times, against all cells."""
    _, lens = _deep(problem, share=0.25)
    sag = lens.rear.sag
    dense = sag
    for level in range(sag.space.levels - 1):
        cells = dense.space.cells
        dense = dense.refine({level: cells[cells[:, 0] == level, 1:]})
    back, whole = sag.space.prolongation(dense.space).T, lens.with_sags([dense])
    beam = problem_rays(problem, (COUNT, COUNT))
    few, many = (
        _evaluation(backend, problem, a, Tracer(backend, a, beam, problem.target_z)) for a in (lens, whole)
    )

    def all_knots() -> tuple[float, Gradients]:
        loss, (gradient,) = many()
        return loss, [back @ gradient]

    return _pair(problem, "levels", few, all_knots)


def _taps(backend: Backend, problem: Problem, lens: Lens) -> list[Row]:
    """The image, for which the tolerance is stated, and the time of loss and gradient."""
    gaussian = replace(problem, optimizer=replace(problem.optimizer, window="gaussian", sigma=1.0))
    tracer, c = (
        Tracer(backend, lens, problem_rays(problem, (COUNT, COUNT)), problem.target_z),
        [sag.coefficients for sag in lens.sags],
    )
    cut, whole = (
        _objective(backend, problem, tracer, GaussianWindow(1.0, k)) for k in (GaussianWindow.cut, FAR_CUT)
    )
    image, other = cut.image(c), whole.image(c)
    (skip,) = [s for s in skips(gaussian) if s.name == "taps"]
    seconds = (median_seconds(lambda o=o: o(c), REPEATS) for o in (cut, whole))
    return _timed(
        "taps", *seconds, float(np.linalg.norm(image - other) / np.linalg.norm(other)), skip.tolerance
    )


def _camera(backend: Backend, problem: Problem, lens: Lens) -> list[Row]:
    """Mitsuba's particle tracer with screen and camera, light forward only: its noise hides every other
    difference."""
    if find_spec("mitsuba") is None:
        return []
    from optics.mitsuba import LensMesh, camera_irradiance, load_mitsuba, mitsuba_scene

    load_mitsuba("llvm_ad_mono", 1)
    scene = mitsuba_scene(problem, LensMesh.even(lens, (COUNT, COUNT)))
    tracer, c = (
        Tracer(backend, lens, problem_rays(problem, (COUNT, COUNT)), problem.target_z),
        [sag.coefficients for sag in lens.sags],
    )
    objective = _objective(backend, problem, tracer, PixelWindow())
    image, other = objective.image(c), camera_irradiance(scene, SPP)
    seconds = (
        median_seconds(lambda: objective.image(c), REPEATS),
        median_seconds(lambda: camera_irradiance(scene, SPP), 3),
    )
    return _timed("camera", *seconds, float(np.linalg.norm(image - other) / np.linalg.norm(image)), None)


def _front(backend: Backend, problem: Problem, lens: Lens) -> list[Row]:
    rays = problem_rays(problem, (512, 512))
    tracers = (kind(backend, lens, rays, problem.target_z, sure=False) for kind in (Tracer, FrontAgain))
    return _pair(problem, "front", *(_evaluation(backend, problem, lens, tracer) for tracer in tracers))


def _gradients(backend: Backend, problem: Problem, lens: Lens) -> list[Row]:
    """The same front with a free sag of zeros, whose gradient is dropped."""
    space = lens.rear.sag.space
    knots = (kv.rescaled(-h, h) for kv, h in zip((space.kv_u, space.kv_v), lens.front.half_width))
    flat = type(space)(*knots)
    free = replace(lens, front=lens.front.with_sag(THBSurface(flat, np.zeros(flat.dim))))
    rays = problem_rays(problem, (512, 512))
    one, two = (
        _evaluation(backend, problem, a, Tracer(backend, a, rays, problem.target_z, sure=False))
        for a in (lens, free)
    )

    def rear_only() -> tuple[float, Gradients]:
        loss, gradients = two()
        return loss, gradients[1:]

    return _pair(problem, "gradients", one, rear_only)


def _converged(backend: Backend, problem: Problem, lens: Lens) -> list[Row]:
    """Steps until the bracket is a rounding wide."""
    rays = problem_rays(problem, (512, 512))
    tracers = [Tracer(backend, lens, rays, problem.target_z, sure=False) for _ in range(2)]
    tracers[1]._rear.settled = 0.0
    return _pair(
        problem, "converged rays", *(_evaluation(backend, problem, lens, tracer) for tracer in tracers)
    )


def _first_meetings(backend: Backend, problem: Problem, lens: Lens) -> list[Row]:
    rays = problem_rays(problem, (512, 512))
    tracers = (Tracer(backend, lens, rays, problem.target_z, sure=sure) for sure in (False, True))
    return _pair(
        problem, "first meetings", *(_evaluation(backend, problem, lens, tracer) for tracer in tracers)
    )


def _compilation(backend: Backend, problem: Problem, lens: Lens) -> list[Row]:
    """Coefficients that change from one evaluation to the next, as they do in a design; 16384 rays."""
    rays = problem_rays(problem, (128, 128))
    literal = replace(backend, dr=Literals(backend.dr))
    c, rng = (
        lens.rear.sag.coefficients,
        np.random.default_rng(),
    )  # other numbers in every run: kernels are kept on disk
    objectives = [
        _objective(b, problem, Tracer(b, lens, rays, problem.target_z, sure=False))
        for b in (backend, literal)
    ]

    def changing(objective: Objective) -> float:
        start = perf_counter()
        objective([c * (1 + 1e-6 * rng.random())])
        return perf_counter() - start

    fast, slow = (float(np.median([changing(o) for _ in range(REPEATS)])) for o in objectives)
    same = _pair(problem, "compilation", *(lambda o=o: o([c]) for o in objectives))[2]
    return [*_timed("compilation", fast, slow, same.value, same.limit)]
