"""Loss and gradient of the exact tracer: time, error of the gradient, set-up, and Mitsuba's meshes beside
it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from statistics import median
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import ROOT
from benchmarks.rows.row import Row, median_seconds
from benchmarks.tracing.error_cases import WINDOW, designed
from optics.base.runtime import Backend, load_backend
from optics.designing.optimisation import Objective, stage_objective, stages
from optics.light.engines import SOFT_RIM, ExactEngine, TracedModel
from optics.light.measuring import Splat
from optics.light.tracing import Tracer
from optics.scene.problem import load_problem
from optics.scene.receivers import BSplineWindow, GaussianWindow, PixelWindow
from optics.scene.system import System
from oracles.error_measures import relative, worst_difference
from thbcad import Lens

RAYS = (449, 449)
EXTENDED_RAYS = (1024, 1024)
REPEATS = 9
# Steps of the differences, mm.  A front moves light over the knots of the rear, which costs long steps their
# order: 3e-7 by steps of 1e-6, 3e-9 by steps of 1e-7, which rounding limits.
STEPS = {"pearl": 1e-6, "extended_two": 1e-7}
SMOOTH = BSplineWindow(
    5
)  # C^4: differences of fourth order lose their order on windows with fewer derivatives
STARTS = 5
START = """
from time import perf_counter
begin = perf_counter()
from benchmarks.tracing.error_limits import first_gradient
imported = perf_counter()
first_gradient()
print(imported - begin, perf_counter() - imported)
"""

Floats = NDArray[np.float64]
Window = PixelWindow | BSplineWindow | GaussianWindow


def limit_rows(backend: Backend, mitsuba: bool) -> list[Row]:
    """Return the measured rows.  mitsuba : it is installed."""
    return [
        *_collimated(backend, mitsuba),
        *_extended(backend),
        *_differences(backend),
        *_set_up(),
        *([_mesh_accuracy(backend)] if mitsuba else []),
    ]


def uniform(lens: Lens) -> Lens:
    """Return the same lens with its rear refined to the finest level everywhere."""
    sag = lens.rear.sag
    return lens.with_sags([*lens.sags[:-1], sag.uniform(sag.space.levels - 1)])


def fit(
    system: System, backend: Backend, window: Window, rays: Sequence[int], soft_rim: float = 0.0
) -> Objective:
    """Return the fit alone as an Objective, on the problem's pixels; the target has the whole source flux."""
    screen = system.target.screen()
    target = system.target.irradiance(screen, system.problem.source.flux)
    tracer = Tracer(backend, system.path.with_soft_rims(soft_rim), system.source.rays(rays), proven=False)
    return Objective(TracedModel(backend, tracer, screen, window), target, 0.0)


def seconds(objective: Objective, lens: Lens, repeats: int = REPEATS) -> float:
    """Return the median time of loss and gradient."""
    at = [sag.coefficients for sag in lens.sags]
    return median_seconds(lambda: objective(at), repeats)


def _collimated(backend: Backend, mitsuba: bool) -> list[Row]:
    system = designed("pearl", backend)
    lens, out = uniform(system.designed), []
    net = "x".join(map(str, lens.rear.sag.to_bspline().coefficients.shape))
    for name, window, limit in (("64 taps", WINDOW, 0.07), ("pixel window, 4 taps", PixelWindow(), 0.03)):
        own = seconds(fit(system.with_lens(lens), backend, window, RAYS), lens)
        out.append(Row(f"loss + gradient, 449^2 rays, net {net}, {name}", own, "s", "", limit))
        if mitsuba:
            target = system.target.irradiance(system.target.screen(), system.problem.source.flux)
            other = seconds(Objective(_mesh_model(system.with_lens(lens), window), target, 0.0), lens, 5)
            least = 20 if window.taps == 2 else None
            out.append(
                Row(
                    f"   Mitsuba mesh pipeline of 449^2 vertices to ours, {name}",
                    other / own,
                    "",
                    f"{other:.3g} s",
                    least,
                    ">=",
                )
            )
    return out


def _extended(backend: Backend) -> list[Row]:
    """Return the times of 2^20 rays of an extended source, searched for as designs do, and the part of it
    that the searches take."""
    system = designed("extended_two", backend)
    lens = system.designed
    title, at, out = (
        "loss + gradient, 2^20 extended rays, 2 free surfaces",
        [sag.coefficients for sag in lens.sags],
        [],
    )
    windows = {"pixel window, 4 taps": PixelWindow(), "quintic window, 36 taps": SMOOTH, "64 taps": WINDOW}
    for name, window in windows.items():
        limit = 0.30 if window.taps == 2 else None
        out.append(
            Row(
                f"{title}, {name}",
                seconds(fit(system.with_lens(lens), backend, window, EXTENDED_RAYS), lens, 5),
                "s",
                "f64",
                limit,
            )
        )
    rays = system.source.rays(EXTENDED_RAYS)
    for name, proven in (
        ("both searches and no derivatives", False),
        ("the same, sure of the first of several meetings", True),
    ):
        tracer = Tracer(backend, system.with_lens(lens).path, rays, proven=proven)

        def search(tracer: Tracer = tracer) -> None:
            with backend.dr.suspend_grad():
                backend.dr.eval(tracer.trace(at)[1].flux)
                backend.dr.sync_thread()

        out.append(Row(f"   {name}", median_seconds(search, 5), "s", "f64"))
    single = load_backend("single", 1)
    time = seconds(fit(system.with_lens(lens), single, PixelWindow(), EXTENDED_RAYS), lens, 5)
    return [*out, Row(f"{title}, {next(iter(windows))}, single precision", time, "s", "f32")]


def _differences(backend: Backend) -> list[Row]:
    """Return the gradient's error for every free surface of two designed lenses."""
    out = []
    for name, rays, soft in (("pearl", RAYS, 0.0), ("extended_two", (256, 256), SOFT_RIM)):
        system = designed(name, backend)
        objective = fit(system, backend, SMOOTH, rays, soft)
        at = [sag.coefficients for sag in system.sags]
        gradients = objective(at).gradients
        for k, surface in enumerate(("front", "rear")[-len(at) :]):

            def loss(c: Floats, own: int = k, every: list[Floats] = at, of: Objective = objective) -> float:
                return of([*every[:own], c, *every[own + 1 :]]).loss

            error = worst_difference(loss, at[k], gradients[k], STEPS[name])
            out.append(
                Row(
                    f"{name}: gradient by the {surface}, worst of 20 differences, quintic window",
                    error,
                    "",
                    "",
                    1e-8,
                )
            )
    return out


def first_gradient() -> float:
    """Return the loss of a pearl design's last stage at its first lens: all that comes before the first
    step."""
    system = System(load_problem(ROOT / "examples" / "pearl.toml"))
    lens, stage, backend = system.base, stages(system, True)[-1], load_backend("double", 1)
    target = system.target.irradiance(stage.screen, 0.92 * system.problem.source.flux)
    objective = stage_objective(system.with_lens(lens), stage, target, ExactEngine(backend))
    return objective([sag.coefficients for sag in lens.sags]).loss


def _set_up() -> list[Row]:
    inside, imports, whole = [], [], []
    for _ in range(STARTS + 1):
        start = perf_counter()
        done = subprocess.run(
            [sys.executable, "-c", START], check=True, capture_output=True, text=True, cwd=ROOT
        )
        whole.append(perf_counter() - start)
        loading, working = map(float, done.stdout.split())
        imports.append(loading)
        inside.append(working)
    note = "pearl, one thread, fresh process, kernels cached"
    return [
        Row("set-up, from problem to first gradient", median(inside[1:]), "s", note, 1),
        Row("   imports before that", median(imports[1:]), "s"),
        Row("   whole process", median(whole[1:]), "s"),
    ]


def _mesh_model(system: System, window: Window) -> TracedModel:
    """Return the light of a lens through Mitsuba's meshes of 449^2 vertices."""
    from optics.exchange.mitsuba import LensMesh, MeshTracer

    mesh, rays = LensMesh.uniform(system.designed, RAYS), system.source.rays(RAYS)
    tracer = MeshTracer(mesh, rays, system.target.receiver)
    return TracedModel(tracer.backend, tracer, system.target.screen(), window)


def _mesh_accuracy(backend: Backend) -> Row:
    """Return the relative L2 error of the irradiance through meshes with analytic normals, f32, on the base
    lens."""
    system = System(load_problem(ROOT / "examples" / "pearl.toml"))
    lens, screen = system.base, system.target.screen()
    tracer = Tracer(backend, system.with_lens(lens).path, system.source.rays(RAYS))
    _, landing = tracer.trace([sag.coefficients for sag in lens.sags])
    image = Splat(backend, screen, WINDOW)(landing.x, landing.y, landing.flux)
    exact = image.numpy().reshape(screen.shape, order="F")
    image = _mesh_model(system.with_lens(lens), WINDOW).image([sag.coefficients for sag in lens.sags])
    error = relative(image, exact)
    return Row(
        "Mitsuba mesh of 449^2 vertices, analytic normals, base lens",
        error,
        "",
        "irradiance against exact, same rays",
        5e-5,
    )
