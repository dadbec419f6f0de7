"""The runs of study 7: the pearl by the thesis's method, its controls, and the project's own designs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import optics
from benchmarks.checkout import EXAMPLES
from benchmarks.designs.camera_engine import camera_engine
from benchmarks.thesis.chapter6.adam_batches import (
    NOWHERE,
    RAYS,
    VERTICES,
    Plan,
    everywhere,
    near_dof,
    same_alpha,
)
from benchmarks.thesis.chapter6.batch_records import designed, recorded
from benchmarks.thesis.records import Found, Run
from optics.base.runtime import load_backend
from optics.light.analysis import Measurement
from optics.light.tracing import Tracer
from optics.scene.problem import Refinement
from optics.scene.system import System
from thbcad import Lens

DOF = (100, 161, 387, 1297, 3818, 11955)  # of Table 6.2
FIRST, FALL = 0.1, 0.5  # step of Adam in the first batch, and its ratio from batch to batch
SCANNED = {  # first step and ratio
    "step 0.1": (0.1, 0.5),
    "step 0.03": (0.03, 0.5),
    "step 0.01": (0.01, 0.5),
    "step 0.1, constant": (0.1, 1.0),
}
SMALL = 128  # pixels of the scan
SMALLER = {"rays": (RAYS[0] // 2 + 1,) * 2, "vertices": VERTICES // 2 + 1}
SMALLEST = 64  # pixels of the quick set
LEAST = {"rays": (RAYS[0] // 4 + 1,) * 2, "vertices": VERTICES // 4 + 1}
# fractions of the picture from above and from the left: the dark wedge between chin and dress
GAP_ROWS, GAP_COLUMNS = (0.64, 0.76), (0.36, 0.44)
INNER = 0.6  # of the beam's width: its inner part, without what its rim sheds
MAPPED = 257  # rays in each direction over all of the beam, of the map of what misses the target
PATHS_STEPS = 50  # of Adam through Mitsuba's particle tracer, of which each takes seconds
PATHS_PER_PIXEL = 2.0  # in each direction
MESHES = {"alpha 0.3": 0.3, "alpha 1": 1.0, "alpha 2": 2.0}  # of the project's own designs


def runs(quick: bool) -> list[Run]:
    """Return the runs; the quick ones have fewer batches, steps, pixels and rays."""
    size = _quick if quick else _full
    return [*_of_the_thesis(size()), *_scan(size()), *_own(quick), *_in_mitsuba(quick)]


def _full() -> tuple[Plan, int]:
    """Return the plan of the thesis's refinement, and the pixels in each direction."""
    return Plan(_steps(FIRST, FALL, len(DOF)), near_dof(DOF)), 256


def _quick() -> tuple[Plan, int]:
    return replace(_full()[0], steps=_steps(FIRST, FALL, 4), iterations=15, **LEAST), SMALLEST


def _steps(first: float, fall: float, count: int) -> tuple[float, ...]:
    return tuple(first * fall**k for k in range(count))


def _of_the_thesis(size: tuple[Plan, int]) -> Iterator[Run]:
    thb, pixels = size
    fixed = replace(thb, marking=same_alpha(NOWHERE), first_level=len(thb.steps) - 1)
    small = replace(fixed, steps=(thb.steps[-1],) * len(thb.steps))
    uniform = replace(thb, marking=everywhere)
    here = partial(_batches, "thesis/pearl", pixels)
    yield Run("thb", lambda _: here(thb, check=thb.rays))
    yield Run("uniform", lambda done: _beside(done["thb"], here(uniform, check=thb.rays)))
    yield Run("fixed", lambda _: here(fixed, pictures=False))
    yield Run("fixed, small steps", lambda _: here(small, pictures=False))
    yield Run("thb, filtered", lambda _: here(replace(thb, filtered=True), pictures=False))
    yield Run("fixed, filtered", lambda _: here(replace(fixed, filtered=True), pictures=False))
    yield Run("thb, as printed", lambda _: _batches("thesis/pearl_as_printed", pixels, thb, pictures=False))
    yield Run("thb, wider bound", lambda _: _batches("pearl", pixels, thb, pictures=False))


def _batches(
    name: str, pixels: int, plan: Plan, check: tuple[int, int] | None = None, pictures: bool = True
) -> Found:
    return recorded(optics.System(_problem(name, pixels)), plan, check, _lost, pictures, each=pictures)


def _beside(thb: Found, found: Found) -> Found:
    """Return a run with the relative L2 difference of its last irradiance to that of THB refinement."""
    last = f"irradiance {len(thb.numbers['step']) - 1}"
    own, other = (np.asarray(f.arrays[last], dtype=float) for f in (found, thb))
    apart = float(np.linalg.norm(own - other) / np.linalg.norm(other))
    return Found({**found.numbers, "apart_from_thb": apart}, found.arrays)


def _problem(name: str, pixels: int, **changes: Any) -> optics.Problem:
    problem = optics.load_problem(EXAMPLES / f"{name}.toml")
    return problem.with_(**{"target.pixels": [pixels, pixels], **changes})


def _lost(lens: Lens, found: Measurement) -> Found:
    """Return the flux on the dark gap, in units of what is asked for there, and what misses the target.

    missed : where on the lens light is refracted past the target.  missed_inside : the flux of such light
    within INNER of the beam, W, so that what the rim of the beam sheds does not count.
    """
    rows, columns = found.target.shape
    gap = (
        slice(*(round(f * rows) for f in GAP_ROWS)),
        slice(*(round(f * columns) for f in GAP_COLUMNS)),
    )
    system = System(_problem("thesis/pearl", columns))
    rays = system.source.rays((MAPPED, MAPPED))
    tracer = Tracer(load_backend("double", None), system.with_lens(lens).path, rays)
    _, landing = tracer.trace([sag.coefficients for sag in lens.sags])
    x, y, flux = (a.numpy().reshape(MAPPED, MAPPED) for a in (landing.x, landing.y, landing.flux))
    missed = (np.abs(x) > system.target.settings.half_width[0]) | (
        np.abs(y) > system.target.settings.half_width[1]
    )
    edge = round(MAPPED * (1 - INNER) / 2)
    inside = np.s_[edge:-edge, edge:-edge]
    return Found(
        {
            "gap": float(found.irradiance[gap].sum() / found.target[gap].sum()),
            "missed_inside": float((flux * missed)[inside].sum()),
        },
        {"missed": missed.astype(np.uint8)},
    )


def _scan(size: tuple[Plan, int]) -> Iterator[Run]:
    """Yield short runs of other steps, all on few pixels."""
    plan, pixels = size
    if pixels > SMALL:
        plan, pixels = replace(plan, iterations=80, **SMALLER), SMALL
    for name, (first, fall) in SCANNED.items():
        chosen = replace(plan, steps=_steps(first, fall, min(4, len(plan.steps) - 1)))
        yield Run(name, lambda _, p=chosen: _batches("thesis/pearl", pixels, p, pictures=False))


def _own(quick: bool) -> Iterator[Run]:
    """Yield designs by the project's own method: three problems, and meshes of one of them."""
    pixels, last = (SMALLEST, 2) if quick else (256, 5)

    def problem(name: str, level: int = last) -> optics.Problem:
        keys = {"lens.rear.freeform.max_level": level, "optimizer.window": "cells"}
        return _problem(name, pixels, **keys, **{"optimizer.iterations": [24]})

    yield Run("own, as printed", lambda _: designed(problem("thesis/pearl_as_printed"), _lost))
    yield Run("own", lambda _: designed(problem("thesis/pearl"), _lost))
    yield Run("own, wider bound", lambda _: designed(problem("pearl"), _lost))
    for level in range(last - 2, last):
        coarse = problem("pearl", level)
        yield Run(f"own, level {last - level} less", lambda _, p=coarse: designed(p, _lost))
    for name, alpha in MESHES.items():
        mesh = replace(problem("pearl"), refinement=Refinement(indicator="vertex", alpha=(alpha,)))
        yield Run(f"own, {name}", lambda _, p=mesh: designed(p, _lost))


def _in_mitsuba(quick: bool) -> list[Run]:
    """Return the first steps in Mitsuba: none in the quick set, where they would take longest of all."""
    return [] if quick else [Run("ptracer", lambda _: ptracer_batches((FIRST,), PATHS_STEPS))]


def ptracer_batches(steps: tuple[float, ...] = _steps(FIRST, FALL, len(DOF)), iterations: int = 250) -> Found:
    """Return the thesis's method in Mitsuba itself: mesh, particle tracer, diffuse screen and camera.

    Every step takes several seconds, so that all 1500 take hours:
    python -c "from benchmarks.thesis.chapter6 import pearl_runs; print(pearl_runs.ptracer_batches().numbers)"
    """
    problem = _problem("thesis/pearl", 256, **{"optimizer.rays_per_pixel": PATHS_PER_PIXEL})
    plan = Plan(steps, near_dof(DOF), iterations, filtered=True, engine=camera_engine())
    return recorded(optics.System(problem), plan, None, _lost, pictures=False)
