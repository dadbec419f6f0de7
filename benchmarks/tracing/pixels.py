"""The irradiance of the pearl lens in box pixels: error beside time, of mapped cells, of binned rays, and of
Mitsuba's particle tracer.

Run: thbcad bench pixels

One thread.  Errors are relative L2 distances from a reference that numpy and scipy make of the text of the
lens's STEP file (`oracles/step_light.py`).  Its own error is a third of what doubling the cells changes,
since it falls with their size squared.  The mean of two sets of binned rays has an error of half their
distance, and lies as far from the reference as both errors let expect.  Mitsuba's time at an error of GOAL is
extrapolated: its noise falls with the square root of the time.  The ratio to our cells is the product of
three: the time of a path to that of a ray, random paths to a grid of rays, and bins to cells.  Where a rim
cuts the light, the flux that misses the rear is compared with the exact one.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from math import asin, cos, inf, pi, radians
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import EXAMPLES
from benchmarks.rows.row import Row
from benchmarks.tracing.error_cases import AT_ONCE, Case, pearl_case, window_image
from benchmarks.tracing.error_methods import BOX, SPP, camera_noise, quantity
from optics.base.runtime import Backend, load_backend
from optics.light.analysis import cell_irradiance, measure
from optics.scene.problem import Problem, load_problem
from optics.scene.receivers import BoxWindow
from optics.scene.system import System
from oracles.error_measures import relative
from oracles.step_light import Beam, Pixels, cell_image, read_rear
from thbcad import write_step

QUANTITY = quantity(BOX)
REFERENCE, CELLS, RAYS, MITSUBA = "independent trace", "cells", "binned rays", "ptracer"
REFERENCE_CELLS = (4096, 8192)  # in each direction
OWN_CELLS, OWN_RAYS = (512, 1024, 2048, 4096), (1024, 4096)
MOST_RAYS = (12007, 14009)  # 3.4e8 rays in two grids; grids of nearly equal spacing share their error
APART = 1.5  # times the distance to expect: both errors are estimates
RIM_CELLS = (211, 769)
GOAL = 1e-3  # of the error
SECONDS = 0.7  # wanted for it on the machine that designs the pearl of version 0.1 in 12.7 s
LIMITS = {CELLS: 1e4, RAYS: 2e2}  # least ratios of Mitsuba's time to ours, below half of those measured

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Light:
    """Irradiance of one run, (rows, columns) W/mm^2.  name : how many cells or rays."""

    estimator: str
    name: str
    image: Floats
    seconds: float


def rows() -> list[Row]:
    """Return the measured rows."""
    backend = load_backend("double", 1)
    case = pearl_case(backend)
    truth, own = step_reference(case)
    both, spread = _both_grids(case, backend)
    lights = [*_by_cells(case, backend), *_by_rays(case, backend), both]
    errors = [relative(light.image, truth) for light in lights]
    apart = errors[-1] / np.hypot(own, spread)
    runs = [(x.estimator, x.seconds, e) for x, e in zip(lights, errors)]
    fastest = min((s for way, s, e in runs if way == CELLS and e <= GOAL), default=np.inf)
    name = f"{REFERENCE_CELLS[-1]}^2 cells of the STEP file's text"
    out = [
        _row(f"{name}: error of the irradiance", own, REFERENCE),
        _row(f"{both.name}: half the distance of two sets", spread, RAYS),
        _row("   distance from the STEP file's light, to that by both errors", apart, RAYS, own, APART),
    ]
    for light, error in zip(lights, errors):
        out += [
            _row(f"{light.name}: error of the irradiance", error, light.estimator, own),
            _row(f"{light.name}: time", light.seconds, light.estimator, error, unit="s"),
        ]
    out.append(_row(f"least time to an error of {GOAL:g}", fastest, CELLS, GOAL, 2 * SECONDS, "s"))
    out += _ratios(case, runs) if find_spec("mitsuba") else []
    return [*out, *_estimate(case, truth, own, backend), *_rims(backend)]


def step_reference(case: Case) -> tuple[Floats, float]:
    """Return the light of the case's STEP file by code of its own, and its relative error."""
    system, screen = case.system, case.system.target.screen()
    source = system.problem.source
    beam = Beam(
        source.half_width,
        source.flux,
        case.system.designed.index,
        system.problem.lens.thickness + system.problem.throw,
    )
    pixels = Pixels(screen.half_width, screen.pixels)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lens.step"
        write_step(case.system.designed, path, system.product)
        rear = read_rear(path)
    coarse, fine = (cell_image(rear, beam, pixels, count) for count in REFERENCE_CELLS)
    return fine, relative(coarse, fine) / 3


def _by_cells(case: Case, backend: Backend) -> Iterator[Light]:
    screen = case.system.target.screen()
    for count in OWN_CELLS:
        for _ in range(2):  # the first compiles
            start = perf_counter()
            path, cells = case.system.path, case.system.source.cells((count, count))
            image, _ = cell_irradiance(path, screen, cells, backend)
            seconds = perf_counter() - start
        yield Light(CELLS, f"{count}^2 cells", image, seconds)


def _by_rays(case: Case, backend: Backend, sides: Sequence[int] = OWN_RAYS) -> Iterator[Light]:
    for side in sides:
        start = perf_counter()
        parts = case.system.source.parts((side, side), None, AT_ONCE)
        image = window_image(case, backend, BoxWindow(), parts)
        yield Light(RAYS, f"{side}^2 binned rays", image, perf_counter() - start)


def _both_grids(case: Case, backend: Backend) -> tuple[Light, float]:
    """Return the mean light of two grids of most rays, and its relative error by their distance."""
    one, other = _by_rays(case, backend, MOST_RAYS)
    mean = (one.image + other.image) / 2
    light = Light(RAYS, "3.4e8 binned rays", mean, one.seconds + other.seconds)
    return light, relative(one.image, other.image) / 2


def _ratios(case: Case, runs: Sequence[tuple[str, float, float]]) -> list[Row]:
    """Return Mitsuba's noise, and its time to that of each of our ways at an error of GOAL.

    Of a way that does not reach it the least error counts.  runs : estimator, seconds and error of ours.
    """
    from optics.exchange.mitsuba import load_mitsuba

    load_mitsuba("llvm_ad_mono", 1)
    few, noise = (camera_noise(case, BOX, paths) for paths in (SPP[0], SPP[-1]))
    order = -np.log(noise.value / few.value) / np.log(noise.paths / few.paths)
    name = f"Mitsuba's ptracer, {noise.paths} paths"
    out = [
        _row(f"{name}: noise", noise.value, MITSUBA),
        _row(f"   order in paths, from {few.paths}", order, MITSUBA),
        _row(f"{name}: time", noise.seconds, MITSUBA, noise.value, unit="s"),
    ]
    ratios: dict[str, Row] = {}
    for way, least in LIMITS.items():
        own = [(seconds, error) for estimator, seconds, error in runs if estimator == way]
        seconds, error = next((run for run in own if run[1] <= GOAL), own[-1])
        name = f"{case.name}: {BOX}, ptracer to {way}"
        ratios[way] = noise.ratio(name, seconds, max(GOAL, error), BOX, least)
    longest = [seconds for estimator, seconds, _ in runs if estimator == RAYS][-1]
    per_ray = noise.seconds / noise.paths / (longest / sum(side**2 for side in MOST_RAYS))
    factors = {
        "time of a path to that of a ray": per_ray,
        "random paths to a grid of rays": ratios[RAYS].value / per_ray,
        "bins to cells": ratios[CELLS].value / ratios[RAYS].value,
    }
    parts = [_row(f"   of that, {name}", value, MITSUBA) for name, value in factors.items()]
    return [*out, ratios[CELLS], *parts, ratios[RAYS]]


def _estimate(case: Case, truth: Floats, own: float, backend: Backend) -> list[Row]:
    """Return the error that `measure` prints against the true one."""
    found = measure(case.system, backend)
    true = float(np.linalg.norm(found.irradiance - truth) / np.linalg.norm(found.target))
    printed = found.metrics["rel_l2_floor"]
    ratio = max(printed / true, true / printed)
    return [
        _row("error printed with rel_l2", printed, CELLS),
        _row("   to the true error, either way", ratio, CELLS, own, 1.2),
    ]


def _rims(backend: Backend) -> list[Row]:
    """Return the error of the flux that misses the rear, relative to that of the source."""
    out = []
    for name, problem, missing in _cut_light():
        system = System(problem)
        for count in RIM_CELLS:
            path, screen = system.with_lens(system.base).path, system.target.screen()
            _, fates = cell_irradiance(path, screen, system.source.cells((count, count)), backend)
            exact = missing * (problem.source.flux - fates.by_name["front_reflected"])
            error = abs(fates.missed_rear - exact) / problem.source.flux
            title = f"{name}, {count}^2 cells: error of the flux past the rear"
            out.append(Row(title, error, quantity="flux past the rear", estimator=CELLS))
    return out


def _cut_light() -> list[tuple[str, Problem, float]]:
    """Return names, problems and what misses the rear of the light in the lens, exactly.

    A beam that is wider than the rear: the rim is parallel to the lines between cells.  A cone of light
    through a front that is a sphere around its tip: the plane rear is a rectangle of known solid angle, and
    its rim crosses the cells.
    """
    pearl = load_problem(EXAMPLES / "pearl.toml")
    lens, source, half = pearl.lens, pearl.source, 40.0
    rear = replace(lens.rear, half_width=(half, half))
    beam = replace(pearl, lens=replace(lens, rear=rear))
    radius, thickness, half, angle = 5.0, 5.0, 3.5, 30.0
    front = replace(lens.front, half_width=(2.6, 2.6), radius=-radius, conic=0.0)
    rear = replace(lens.rear, half_width=(half, half), radius=inf)
    lens = replace(lens, front=front, rear=rear, thickness=thickness)
    point = replace(source, kind="point", half_angle=angle, exponent=0.0, distance=radius)
    cone = replace(pearl, lens=lens, source=point)
    far = half**2 + (radius + thickness) ** 2
    solid = 4 * asin(half**2 / far) / (2 * pi * (1 - cos(radians(angle))))
    return [
        ("beam over a rim", beam, 1 - (beam.lens.rear.half_width[0] / source.half_width[0]) ** 2),
        ("cone over a rim", cone, 1 - solid),
    ]


def _row(
    name: str, value: float, way: str, error: float | None = None, limit: float | None = None, unit: str = ""
) -> Row:
    return Row(name, value, unit, "", limit, quantity=QUANTITY, estimator=way, error=error)
