"""The lenses of `thbcad bench error`, their rays on grids, and the reference.

The reference are two sets of very many rays in double precision.  The error of a grid falls with the square
of its spacing: of two grids the finer one counts, which has twice the rays, and their distance is its error.
The errors of scrambled Sobol points are independent: their mean counts, with half their distance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import BUILD, EXAMPLES
from optics.base.runtime import Backend, DrArray
from optics.designing.optimisation import shape_lens
from optics.light.engines import ExactEngine
from optics.light.intersections import Hits
from optics.light.measuring import Splat
from optics.light.tracing import Tracer
from optics.scene.problem import load_problem
from optics.scene.receivers import BoxWindow, BSplineWindow, GaussianWindow, PixelWindow, Screen, filter_image
from optics.scene.sources import RayGrid, Rays
from optics.scene.system import System
from oracles.error_measures import relative, slope_of_fit
from oracles.ray_samplings import grid_points, sampled_rays
from thbcad import read_lens, write_lens

STORE = BUILD / "error"
ITERATIONS = {"pearl": 10, "extended": 4, "extended_two": 4}  # of L-BFGS per level: enough for a rough lens
WINDOW = GaussianWindow(1.0)
REFERENCE_RAYS = 1 << 23  # of a set, half of the coarser grid: no grid that is measured has as many
AT_ONCE = 1 << 21

Window = BoxWindow | PixelWindow | BSplineWindow | GaussianWindow
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Case:
    """A lens with what is asked of it.  target : irradiance on the pixels, W/mm^2, (rows, columns),
    unfiltered."""

    name: str
    system: System
    target: Floats

    @property
    def screen(self) -> Screen:
        """The pixels of the optimiser."""
        return self.system.target.screen(self.system.problem.optimizer.merge)

    @property
    def coefficients(self) -> list[Floats]:
        return [sag.coefficients for sag in self.system.sags]


@dataclass(frozen=True, eq=False)
class Reference:
    """Irradiance of the window, (rows, columns), and gradient of the fit, with their own relative errors."""

    image: Floats
    gradient: Floats
    image_error: float
    gradient_error: float


def designed(name: str, backend: Backend) -> System:
    """Return an example with a lens designed in few iterations; it is kept in build/error."""
    problem = load_problem(EXAMPLES / f"{name}.toml")
    path = STORE / f"{name}.json"
    if not path.exists():
        options = replace(problem.optimizer, iterations=(ITERATIONS[name],), finish=0, rays_per_pixel=4.0)
        brief = replace(problem, optimizer=options)
        shaped, _ = shape_lens(System(brief), backend, ExactEngine(backend))
        STORE.mkdir(parents=True, exist_ok=True)
        write_lens(shaped.designed, path)
    return System(problem).with_lens(read_lens(path))


def pearl_case(backend: Backend) -> Case:
    """Return the pearl lens."""
    return _case("pearl", designed("pearl", backend), backend)


def cases(backend: Backend) -> list[Case]:
    """Return the base lens, the pearl lens and the lens of the extended source."""
    pearl = designed("pearl", backend)
    named = {
        "base": pearl.unshaped,
        "pearl": pearl,
        "extended": designed("extended", backend),
    }
    return [_case(name, system, backend) for name, system in named.items()]


def _case(name: str, system: System, backend: Backend) -> Case:
    """Return the case whose target holds as much light as reaches the pixels."""
    lens = system.designed
    screen = system.target.screen(system.problem.optimizer.merge)
    tracer = Tracer(backend, system.path, system.source.rays((257, 257)))
    _, landing = tracer.trace([sag.coefficients for sag in lens.sags])
    flux = tracer.fates(landing, screen.half_width).on_target
    return Case(name, system, system.target.irradiance(screen, flux))


def reference(case: Case, backend: Backend, window: Window = WINDOW) -> Reference:
    """Return the Reference of a case."""
    images = [window_image(case, backend, window, _many_rays(case, which)) for which in (0, 1)]
    target = filter_image(case.target, window)
    gradients = [
        _gradient(case, backend, window, _many_rays(case, k), slope_of_fit(e, target))
        for k, e in enumerate(images)
    ]
    (image, image_error), (gradient, gradient_error) = (_joined(case, *pair) for pair in (images, gradients))
    return Reference(image, gradient, image_error, gradient_error)


def _joined(case: Case, first: Floats, second: Floats) -> tuple[Floats, float]:
    """Return what two sets of rays say together, and its relative error."""
    apart = relative(first, second)
    return (second, apart) if case.system.source.collimated else ((first + second) / 2, apart / 2)


def _many_rays(case: Case, which: int) -> Iterator[RayGrid | Rays]:
    """Return one of two sets: grids, the second with twice the rays, or scrambled Sobol points."""
    if case.system.source.collimated:
        side = round((REFERENCE_RAYS / 2 ** (1 - which)) ** 0.5)
        return case.system.source.parts((side, side), None, AT_ONCE)
    side = round(REFERENCE_RAYS**0.5)
    return case.system.source.parts((side, side), np.random.default_rng(1 + which), AT_ONCE)


def _landed(
    case: Case, backend: Backend, window: Window, part: RayGrid | Rays
) -> tuple[Tracer, list[Hits], DrArray]:
    tracer = Tracer(backend, case.system.path, part)
    hits, landing = tracer.trace(case.coefficients)
    return tracer, hits, Splat(backend, case.screen, window)(landing.x, landing.y, landing.flux)


def window_image(case: Case, backend: Backend, window: Window, parts: Iterator[RayGrid | Rays]) -> Floats:
    """Return the irradiance of rays in a window, (rows, columns)."""
    total = np.zeros(case.screen.shape)
    with backend.dr.suspend_grad():
        for part in parts:
            total += _landed(case, backend, window, part)[2].numpy().reshape(case.screen.shape, order="F")
    return total


def _gradient(
    case: Case, backend: Backend, window: Window, parts: Iterator[RayGrid | Rays], seed: Floats
) -> Floats:
    """Return the derivative of sum(seed * image) by all coefficients, (dof,)."""
    total, weights = 0.0, backend.array(seed.T)
    for part in parts:
        tracer, hits, image = _landed(case, backend, window, part)
        backend.dr.backward(backend.dr.sum(image * weights))
        total = total + np.concatenate(tracer.pull_back(hits))
    return total


def grid_rays(case: Case, count: int) -> RayGrid | Rays:
    """Return about `count` rays on the grid that suits the tracer best: a RayGrid for a collimated source."""
    if case.system.source.collimated:
        side = round(count**0.5)
        return case.system.source.rays((side, side))
    return sampled_rays(case.system.problem.source, case.system.designed, grid_points, count)
