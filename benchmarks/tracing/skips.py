"""What every skip of `optics.scene.system` saves, and what it changes: loss and gradient with and without it.

Run: thbcad bench skips

Every variant without a skip is built here; one thread, medians.  Limits are the tolerances that `skips`
states.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from importlib.util import find_spec
from time import perf_counter
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import EXAMPLES
from benchmarks.rows.row import Row, median_seconds
from optics.base.runtime import Backend, DrArray, load_backend
from optics.designing.optimisation import (
    MARGIN,
    Objective,
    shape_lens,
    stage_objective,
    stages,
)
from optics.light.analysis import measure
from optics.light.engines import ExactEngine, TracedModel
from optics.light.measuring import Mirrors, Splat, symmetry_axes
from optics.light.tracing import TargetArea, Tracer, trace_nonsequential
from optics.scene.problem import load_problem
from optics.scene.receivers import BoxWindow, BSplineWindow, GaussianWindow, PixelWindow
from optics.scene.sources import RayGrid, collimated_beam, single_rays
from optics.scene.system import System
from thbcad import Lens, THBSurface

COUNT, REPEATS = 449, 9
WINDOW = BSplineWindow(3)
FAR_CUT = 8.0  # sigma, where a Gaussian is 1e-14
SPP = 4
LIGHT_ALIKE = (
    5e-3  # relative: the sharp light behind a blur has other cells, on a lens as rough as their size
)
MIRRORED = 1e-12  # relative change of loss and gradient by tracing one half

Gradients = list[NDArray[np.float64]]
Evaluate = Callable[[], tuple[float, Gradients]]


class FrontAgain(Tracer):
    """A tracer that traces the frozen front in every evaluation."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._fixed, self._behind = [], self._source


class Literals:
    """Dr.Jit with numbers that become constants of the kernels."""

    def __init__(self, dr: Any) -> None:
        self._dr = dr

    def __getattr__(self, name: str) -> Any:
        return getattr(self._dr, name)

    def opaque(self, kind: type[DrArray], value: float) -> DrArray:
        return kind(value)


def rows() -> list[Row]:
    """Return the measured rows."""
    backend = load_backend("double", 1)
    problems = (load_problem(EXAMPLES / f"{name}.toml") for name in ("pearl", "extended"))
    pearl, extended = (system.with_lens(_deep(system)) for system in map(System, problems))
    return [
        *_meeting_points(pearl, backend),
        *_aperture(pearl, backend),
        *_edges(pearl, backend),
        *_levels(pearl, backend),
        *_taps(pearl, backend),
        *_front(extended, backend),
        *_gradients(extended, backend),
        *_converged(extended, backend),
        *_first_meetings(extended, backend),
        *_compilation(extended, backend),
        *_camera(pearl, backend),
        *_mirror(extended, backend),
        *_fresnel(pearl, backend),
        *_measured(pearl, backend),
        *_whole_design(),
    ]


def _deep(system: System, levels: int = 4, share: float = 1.0) -> Lens:
    """Return the base lens with a rough sag; share : of the width whose cells are refined, from one
    corner."""
    lens, rng = system.base, np.random.default_rng(1)
    sag = lens.rear.sag
    for level in range(levels):
        cells = sag.space.cells
        limit = share * np.array([sag.space.kv_u.spans, sag.space.kv_v.spans]) * 2**level
        sag = sag.refine({level: cells[(cells[:, 0] == level) & (cells[:, 1:] < limit).all(axis=1), 1:]})
    height = 1e-4 * max(lens.rear.half_width)
    return lens.with_sags([THBSurface(sag.space, rng.uniform(-height, height, sag.space.dim))])


def _objective(
    system: System,
    backend: Backend,
    tracer: Tracer,
    window: PixelWindow | BSplineWindow | GaussianWindow = WINDOW,
) -> Objective:
    options = system.problem.optimizer
    screen = system.target.screen(options.merge, MARGIN)
    target = system.target.irradiance(screen, system.problem.source.flux)
    return Objective(TracedModel(backend, tracer, screen, window), target, options.lost_flux_weight)


def _evaluation(system: System, backend: Backend, tracer: Tracer) -> Evaluate:
    """Return a function without arguments that returns loss and gradients."""
    objective = _objective(system, backend, tracer)
    return lambda: _loss_and_gradients(objective, [sag.coefficients for sag in system.designed.sags])


def _loss_and_gradients(objective: Objective, coefficients: Gradients) -> tuple[float, Gradients]:
    found = objective(coefficients)
    return found.loss, found.gradients


def _tolerance(system: System, name: str) -> float | None:
    """Return the relative change that a skip of the system states."""
    (skip,) = [s for s in system.skips if s.name == name]
    return skip.tolerance


def _pair(system: System, name: str, with_skip: Evaluate, without: Evaluate) -> list[Row]:
    """Return times of both variants and the relative difference of the results."""
    (loss, gradients), (other_loss, other_gradients) = with_skip(), without()
    g, other = np.concatenate(gradients), np.concatenate(other_gradients)
    difference = max(
        abs(loss - other_loss) / abs(other_loss), float(np.linalg.norm(g - other) / np.linalg.norm(other))
    )
    seconds = (median_seconds(evaluate, REPEATS) for evaluate in (with_skip, without))
    return _timed(name, *seconds, difference, _tolerance(system, name))


def _timed(name: str, fast: float, slow: float, difference: float, limit: float | None) -> list[Row]:
    return [
        Row(f"{name}: skipped", fast, "s"),
        Row(f"{name}: not skipped", slow, "s", f"{slow / fast:.2f} times"),
        Row(f"{name}: relative difference of the results", difference, "", "", limit),
    ]


def _tracers(system: System, backend: Backend, name: str, tracers: Iterable[Tracer]) -> list[Row]:
    """Return the rows of two tracers of one lens, with the skip and without."""
    return _pair(system, name, *(_evaluation(system, backend, tracer) for tracer in tracers))


def _meeting_points(system: System, backend: Backend) -> list[Row]:
    beam = system.source.rays((COUNT, COUNT))
    tracers = (Tracer(backend, system.path, rays) for rays in (beam, single_rays(beam, system.designed)))
    return _tracers(system, backend, "meeting points", tracers)


def _aperture(system: System, backend: Backend) -> list[Row]:
    """A beam 1.5 times as wide as the lens, on one grid."""
    half = system.designed.front.half_width
    beam = collimated_beam([1.5 * h for h in half], system.problem.source.flux, half, (300, 300))
    x, y = ((np.arange(450) - 224.5) * (2 * h / 300) for h in half)
    whole = RayGrid(x, y, np.full((450, 450), beam.flux[0, 0]))
    tracers = (Tracer(backend, system.path, rays) for rays in (beam, whole))
    return _tracers(system, backend, "aperture", tracers)


def _edges(system: System, backend: Backend) -> list[Row]:
    """Light forward only; the closed lens has no gradient."""
    lens = system.designed
    beam, c = system.source.rays((129, 129)), [sag.coefficients for sag in lens.sags]
    tracer, half = Tracer(backend, system.path, beam), system.target.settings.half_width
    rays, plane = single_rays(beam, lens), TargetArea(system.target.receiver, half)
    found = trace_nonsequential(backend, lens, rays, plane)
    flux = found.landings.flux
    onto = (abs(found.landings.x) <= half[0]) & (abs(found.landings.y) <= half[1])
    direct = flux[onto & found.direct].sum()

    def sequential() -> float:
        return tracer.fates(tracer.trace(c)[1], half).on_target

    fast, slow = (
        median_seconds(sequential, REPEATS),
        median_seconds(lambda: trace_nonsequential(backend, lens, rays, plane), 3),
    )
    other = Row("edges: light on the target by other ways, share", float(1 - direct / flux[onto].sum()))
    difference = abs(sequential() / direct - 1)
    return [*_timed("edges", fast, slow, difference, _tolerance(system, "edges")), other]


def _levels(system: System, backend: Backend) -> list[Row]:
    """Cells of a quarter of the width refined four times, against all cells."""
    lens = _deep(system, share=0.25)
    sag = lens.rear.sag
    dense = sag.uniform(sag.space.levels - 1)
    back, whole = sag.space.prolongation(dense.space).T, lens.with_sags([dense])
    beam = system.source.rays((COUNT, COUNT))
    few, many = (
        _evaluation(system.with_lens(a), backend, Tracer(backend, system.with_lens(a).path, beam))
        for a in (lens, whole)
    )

    def all_knots() -> tuple[float, Gradients]:
        loss, (gradient,) = many()
        return loss, [back @ gradient]

    return _pair(system, "levels", few, all_knots)


def _taps(system: System, backend: Backend) -> list[Row]:
    """The image, for which the tolerance is stated, and the time of loss and gradient."""
    optimizer = replace(system.problem.optimizer, window="gaussian", sigma=1.0)
    gaussian = System(replace(system.problem, optimizer=optimizer))
    tracer = Tracer(backend, system.path, system.source.rays((COUNT, COUNT)))
    windows = (GaussianWindow(1.0, k) for k in (GaussianWindow.cut, FAR_CUT))
    cut, whole = (_objective(system, backend, tracer, window) for window in windows)
    c = [sag.coefficients for sag in system.designed.sags]
    image, other = cut.image(c), whole.image(c)
    seconds = (median_seconds(lambda o=o: o(c), REPEATS) for o in (cut, whole))
    difference = float(np.linalg.norm(image - other) / np.linalg.norm(other))
    return _timed("taps", *seconds, difference, _tolerance(gaussian, "taps"))


def _camera(system: System, backend: Backend) -> list[Row]:
    """Mitsuba's particle tracer with screen and camera, and about as many rays binned in the same box pixels,
    light forward only.

    Its noise hides every other difference: `thbcad bench pixels` compares times at equal errors.
    """
    lens = system.designed
    if find_spec("mitsuba") is None:
        return []
    from optics.exchange.mitsuba import LensMesh, camera_irradiance, load_mitsuba, mitsuba_scene

    load_mitsuba("llvm_ad_mono", 1)
    scene = mitsuba_scene(system, LensMesh.uniform(lens, (COUNT, COUNT)))
    tracer = Tracer(backend, system.path, system.source.rays((COUNT, COUNT)))
    screen, c = system.target.screen(), [sag.coefficients for sag in lens.sags]
    splat = Splat(backend, screen, BoxWindow())

    def binned() -> NDArray[np.float64]:
        with backend.dr.suspend_grad():
            _, landing = tracer.trace(c)
            return splat(landing.x, landing.y, landing.flux).numpy().reshape(screen.shape, order="F")

    image, other = binned(), camera_irradiance(scene, SPP)
    seconds = median_seconds(binned, REPEATS), median_seconds(lambda: camera_irradiance(scene, SPP), 3)
    return _timed("camera", *seconds, float(np.linalg.norm(image - other) / np.linalg.norm(image)), None)


def _front(system: System, backend: Backend) -> list[Row]:
    rays = system.source.rays((512, 512))
    tracers = (kind(backend, system.path, rays, proven=False) for kind in (Tracer, FrontAgain))
    return _tracers(system, backend, "front", tracers)


def _gradients(system: System, backend: Backend) -> list[Row]:
    """The same front with a free sag of zeros, whose gradient is dropped."""
    lens = system.designed
    space = lens.rear.sag.space
    knots = (kv.rescale(-h, h) for kv, h in zip((space.kv_u, space.kv_v), lens.front.half_width))
    flat = type(space)(*knots)
    free = replace(lens, front=lens.front.with_sag(THBSurface(flat, np.zeros(flat.dim))))
    rays = system.source.rays((512, 512))
    one, two = (
        _evaluation(
            system.with_lens(a), backend, Tracer(backend, system.with_lens(a).path, rays, proven=False)
        )
        for a in (lens, free)
    )

    def rear_only() -> tuple[float, Gradients]:
        loss, gradients = two()
        return loss, gradients[1:]

    return _pair(system, "gradients", one, rear_only)


def _converged(system: System, backend: Backend) -> list[Row]:
    """Steps until the residual is a five-hundredth of what settles, the last above rounding."""
    rays = system.source.rays((512, 512))
    tracers = [Tracer(backend, system.path, rays, proven=False) for _ in range(2)]
    tracers[1]._surfaces[1].hits.settled = 1e-3
    return _tracers(system, backend, "converged rays", tracers)


def _first_meetings(system: System, backend: Backend) -> list[Row]:
    rays = system.source.rays((512, 512))
    tracers = (Tracer(backend, system.path, rays, proven=proven) for proven in (False, True))
    return _tracers(system, backend, "first meetings", tracers)


def _compilation(system: System, backend: Backend) -> list[Row]:
    """Coefficients that change from one evaluation to the next, as they do in a design; 16384 rays."""
    rays, c = system.source.rays((128, 128)), system.designed.rear.sag.coefficients
    rng = np.random.default_rng()  # other numbers in every run: kernels are kept on disk
    objectives = [
        _objective(system, b, Tracer(b, system.path, rays, proven=False))
        for b in (backend, replace(backend, dr=Literals(backend.dr)))
    ]

    def changing(objective: Objective) -> float:
        start = perf_counter()
        objective([c * (1 + 1e-6 * rng.random())])
        return perf_counter() - start

    fast, slow = (float(np.median([changing(o) for _ in range(REPEATS)])) for o in objectives)
    same = _pair(system, "compilation", *(lambda o=o: _loss_and_gradients(o, [c]) for o in objectives))[2]
    return [*_timed("compilation", fast, slow, same.value, same.limit)]


def _mirror(system: System, backend: Backend) -> list[Row]:
    """One half of the rays of a mirror-symmetric problem, on a symmetric lens."""
    lens = system.designed
    stage = stages(system, False)[-1]
    target = system.target.irradiance(stage.screen, 0.88)
    axes = symmetry_axes(system)
    mirrors = [Mirrors(sag.space, axes) for sag in lens.sags]
    c = [m.of_coefficients(sag.coefficients) for m, sag in zip(mirrors, lens.sags)]

    def evaluate(objective: Objective) -> tuple[float, Gradients]:
        loss, gradients = _loss_and_gradients(objective, c)
        return loss, [m.of_coefficients(g) for m, g in zip(mirrors, gradients)]

    half, whole = (stage_objective(system, stage, target, ExactEngine(backend), a) for a in (axes, ()))
    (loss, gradients), (other_loss, others) = evaluate(half), evaluate(whole)
    distance = max(np.linalg.norm(g - o) / np.linalg.norm(o) for g, o in zip(gradients, others))
    seconds = (median_seconds(lambda o=o: o(c), REPEATS) for o in (half, whole))
    difference = max(abs(loss / other_loss - 1), float(distance))
    return _timed("mirror images", *seconds, difference, MIRRORED)


def _fresnel(system: System, backend: Backend) -> list[Row]:
    rays = system.source.rays((COUNT, COUNT))
    path = system.path
    tracers = (Tracer(backend, each, rays) for each in (path.without_reflection(), path))
    without, with_losses = (_evaluation(system, backend, tracer) for tracer in tracers)
    seconds = [median_seconds(evaluate, REPEATS) for evaluate in (without, with_losses)]
    return _timed("fresnel", *seconds, abs(without()[0] / with_losses()[0] - 1), None)


def _measured(system: System, backend: Backend) -> list[Row]:
    """The measurement of light that is parallel, or has one wavelength, by what others need."""
    lens = system.designed
    flat = [[400.0, system.base.index], [700.0, system.base.index]]
    lines = [[nm, 1.0] for nm in np.linspace(450.0, 650.0, 10)]
    others = {
        "blur": {"source.divergence": 1e-7},
        "wavelengths": {"source.spectrum": lines, "lens.indices": flat},
    }
    plain = measure(system, backend).irradiance
    fast, out = median_seconds(lambda: measure(system, backend), 3), []
    for name, changes in others.items():
        other = System(system.problem.with_(**changes))
        image = measure(other.with_lens(lens), backend).irradiance
        slow = median_seconds(lambda o=other: measure(o.with_lens(lens), backend), 1)
        difference = float(np.linalg.norm(image - plain) / np.linalg.norm(plain))
        out += _timed(f"{name}, measurement", fast, slow, difference, LIGHT_ALIKE)
    return out


def _whole_design() -> list[Row]:
    """The square top hat with every skip that a problem can set, and with none of them.

    Without: the whole source is traced, every cell is refined, vertex gradients are computed on every level.
    """
    problem = load_problem(EXAMPLES / "tophat_square.toml")
    lean = replace(problem, optimizer=replace(problem.optimizer, fresnel=False))
    full = replace(problem, refinement=replace(problem.refinement, indicator="vertex", alpha=(0.0,)))
    backend, seconds, errors = load_backend("double"), [], []
    for chosen, axes in ((lean, (0, 1)), (full, ())):
        system = System(chosen)
        with patch("optics.designing.optimisation.loop.symmetry_axes", return_value=axes):
            seconds.append(median_seconds(lambda s=system: shape_lens(s, backend, ExactEngine(backend)), 3))
            shaped, _ = shape_lens(system, backend, ExactEngine(backend))
        errors.append(measure(System(problem).with_lens(shaped.designed), backend).metrics["rel_l2"])
    return [
        Row("whole design of a top hat, all skips: optimisation", seconds[0], "s", f"rel_l2 {errors[0]:.4f}"),
        Row(
            "whole design of a top hat, no skips: optimisation",
            seconds[1],
            "s",
            f"{seconds[1] / seconds[0]:.2f} times, rel_l2 {errors[1]:.4f}",
        ),
    ]
