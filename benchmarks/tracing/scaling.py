"""How the time of loss and gradient grows: with rays, pixels, degrees of freedom, levels of refinement and
cores.

The pearl problem with the pixel window; each row carries the time and, last of its kind, the observed
exponent.  Last comes tracing alone over nearly plane sheets, all with a sag, in the light of a point: what
happens at one must not be done again for those behind.

Run: thbcad bench scaling
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from statistics import median

import numpy as np

from benchmarks.checkout import ROOT
from benchmarks.rows.row import Row, median_seconds
from optics.base.runtime import Backend, load_backend
from optics.designing.optimisation import Objective
from optics.light.engines import TracedModel
from optics.light.tracing import Tracer
from optics.scene.paths import AIR, LightPath, Medium, Surface
from optics.scene.problem import load_problem
from optics.scene.receivers import PixelWindow
from optics.scene.system import System
from oracles.error_measures import exponent
from thbcad import KnotVector, Lens, THBSpace, THBSurface
from thbcad.lens import FreeformSurface
from thbcad.poses import Pose

RAYS = tuple(1 << k for k in range(14, 23))
PIXELS = (64, 128, 256, 512, 1024)
SPANS = (16, 28, 56, 112, 224, 448)  # nets of 19^2 to 451^2
LEVELS = 6
SURFACES = (2, 4, 8)
PER_SURFACE = 1.1  # at most, of four surfaces to two
ROUGH = 1e-3  # mm
MIDDLE = 449  # rays in each direction, where they do not change
CORNER = 4  # cells in each direction that a level refines
REPEATS = 5


def rows() -> list[Row]:
    """Return the measured rows."""
    problem = load_problem(ROOT / "examples" / "pearl.toml")
    system, one = System(problem), load_backend("double", 1)
    net = _tensor(system, SPANS[-2])
    out = []
    out += _series("rays", RAYS, [_seconds(system.with_lens(net), round(n**0.5), one) for n in RAYS])
    targets = [replace(problem.target, pixels=(n, n)) for n in PIXELS]
    by_pixels = [System(replace(problem, target=target)) for target in targets]
    out += _series(
        "pixels", [n * n for n in PIXELS], [_seconds(s.with_lens(net), MIDDLE, one) for s in by_pixels]
    )
    lenses = [_tensor(system, n) for n in SPANS]
    out += _series(
        "coefficients",
        [_dof(lens) for lens in lenses],
        [_seconds(system.with_lens(lens), MIDDLE, one) for lens in lenses],
    )
    deep = [_corner(system, n) for n in range(1, LEVELS + 1)]
    times = [_seconds(system.with_lens(lens), MIDDLE, one) for lens in deep]
    out += _series("levels", range(1, LEVELS + 1), times, [f"{_dof(lens)} coefficients" for lens in deep])
    cores = sorted({1, len(os.sched_getaffinity(0))})
    out += _series(
        "cores", cores, [_seconds(system.with_lens(net), 1025, load_backend("double", n)) for n in cores]
    )
    load_backend("double", 1)
    return out + _surfaces(one)


def _series(
    name: str, sizes: Sequence[int], seconds: Sequence[float], notes: Sequence[str] | None = None
) -> list[Row]:
    """Return the rows of one series, the exponent over all of it and that between its last two."""
    out = [
        Row(f"{name}: {n}", s, "s", note) for n, s, note in zip(sizes, seconds, notes or [""] * len(seconds))
    ]
    if len(sizes) > 1:
        out.append(
            Row(
                f"{name}: observed exponent",
                exponent(sizes, seconds),
                "",
                f"of the last two {exponent(sizes[-2:], seconds[-2:]):.2f}",
            )
        )
    return out


def _seconds(system: System, side: int, backend: Backend) -> float:
    """Return the median time of loss and gradient with side x side rays."""
    screen = system.target.screen()
    target = system.target.irradiance(screen, system.problem.source.flux)
    tracer = Tracer(backend, system.path, system.source.rays((side, side)))
    objective = Objective(TracedModel(backend, tracer, screen, PixelWindow()), target, 0.0)
    at = [sag.coefficients for sag in system.designed.sags]
    return median_seconds(lambda: objective(at), REPEATS)


def _surfaces(backend: Backend) -> list[Row]:
    """Return the times of tracing over few and many surfaces, and of derivatives by all of them, side by
    side."""
    system, dr = System(load_problem(ROOT / "examples" / "point.toml")), backend.dr
    rays, times = system.source.rays((MIDDLE, MIDDLE)), dict[tuple[str, int], list[float]]()
    tracers = {n: Tracer(backend, _sheets(system, n), rays) for n in SURFACES}

    def traced(n: int) -> None:
        with dr.suspend_grad():
            landing = tracers[n].trace()[1]
            dr.eval(landing.x, landing.y, landing.flux)
            dr.sync_thread()

    def derived(n: int) -> None:
        hits, landing = tracers[n].trace()
        dr.backward(dr.sum(landing.flux * (landing.x * landing.x + landing.y * landing.y)))
        tracers[n].pull_back(hits)

    for _ in range(REPEATS):  # in turn
        for name, work in (("surfaces", traced), ("surfaces, derivatives too", derived)):
            for n in SURFACES:
                times.setdefault((name, n), []).append(median_seconds(partial(work, n), 1))
    out = []
    for name in dict.fromkeys(name for name, _ in times):
        few, many = (times[name, n] for n in SURFACES[:2])
        ratio = median(b * SURFACES[0] / (a * SURFACES[1]) for a, b in zip(few, many))
        out += _series(name, SURFACES, [median(times[name, n]) for n in SURFACES])
        out.append(Row(f"{name}: seconds per surface, of four to two", ratio, limit=PER_SURFACE))
    return out


def _sheets(system: System, count: int) -> LightPath:
    """Return a path through sheets of glass with rough surfaces, 2 mm apart."""
    rng, space = np.random.default_rng(1), THBSpace(*_knots(system, SPANS[2]))
    half, media = system.base.rear.half_width, (AIR, Medium(system.base.index))
    sags = (THBSurface(space, rng.uniform(-ROUGH, ROUGH, space.dim)) for _ in range(count))
    surfaces = (
        Surface(FreeformSurface(half, sag=sag), Pose.at((0, 0, 2.0 * k))) for k, sag in enumerate(sags)
    )
    return LightPath(tuple(surfaces), (*media * (count // 2), AIR), system.target.receiver)


def _dof(lens: Lens) -> int:
    return sum(sag.space.dim for sag in lens.sags)


def _with_space(system: System, space: THBSpace) -> Lens:
    """Return the base lens with a sag of zeros in a space."""
    return system.base.with_sags([THBSurface(space, np.zeros(space.dim))])


def _tensor(system: System, spans: int) -> Lens:
    """Return the base lens with a uniform net of spans x spans cubic cells."""
    return _with_space(system, THBSpace(*_knots(system, spans)))


def _corner(system: System, levels: int) -> Lens:
    """Return the base lens whose corner is refined to a number of levels: the finest knots are as many as if
    all were."""
    space = THBSpace(*_knots(system, 7))
    for level in range(levels - 1):
        cells = np.argwhere(np.ones((CORNER, CORNER)))
        space = space.refine({level: cells})
    return _with_space(system, space)


def _knots(system: System, spans: int) -> list[KnotVector]:
    return [KnotVector.uniform(3, spans, -h, h) for h in system.base.rear.half_width]
