"""The extended source of Table 6.3 of the thesis: two designs by five seeds each, and the thesis's method
from the same start.

A value is the median over the seeds of the rays; the least and the greatest of them stand below it.

Run: thbcad bench extended
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

import optics
from benchmarks.checkout import BUILD, EXAMPLES
from benchmarks.designs.design_run import IRRADIANCE, LANDING, DesignRun, rel_l2_row, run_design
from benchmarks.page_picture import keep
from benchmarks.rows.row import Row, median_seconds
from benchmarks.thesis.chapter6.adam_batches import BOTH_FILTERED, adam_batches
from optics.base.runtime import Backend, load_backend
from optics.designing.optimisation import Listener, State, shape_lens
from optics.exchange.results import ResultFolder
from optics.exchange.verification import StepFile, verify
from optics.light.analysis import counted_ways, nonsequential_light, ray_irradiance
from optics.light.engines import ExactEngine
from optics.scene.keys import problem_to_toml
from optics.scene.problem import load_problem
from optics.scene.system import System
from oracles.source_image import Scene, SourceImage, pixel_irradiance
from thbcad import write_step

DESIGNS = BUILD / "extended"
BLOCKS = 8  # of the target in each direction, with one pixel of each compared
GAUSS = 4  # points of the source's image in each direction of a pixel
SEEDS = range(5)
SECONDS, WITHOUT_NOISE = {"extended": 45, "extended_two": 55}, {"extended": 0.19, "extended_two": 0.11}
THESIS_SECONDS, THESIS_FLUX = "thesis 1763 s", "thesis 0.74 W"


def rows() -> list[Row]:
    """Return the measured rows."""
    system, backend = System(load_problem(EXAMPLES / "extended.toml")), load_backend("double")
    adam, other = _adam(optics.System(system.problem))
    result = DESIGNS / "extended"
    one = [*_designs("extended", other), _other_ways(result), *_source_image(result)]
    two = _designs("extended_two", other)
    with tempfile.TemporaryDirectory() as folder:
        batches = _batches(system, backend, Path(folder) / "batch.step")
        short = _without_finish(Path(folder))
    return [*one, *two, *short, *adam, *batches]


def publish() -> None:
    """Keep the light of both designs in docs/pictures."""
    for name in ("extended", "extended_two"):
        keep(DESIGNS / name / "figures" / "irradiance.png", f"{name}_irradiance")


def _designs(name: str, other: dict[str, float]) -> list[Row]:
    """Return the rows of an example, over SEEDS; the folder of the first seed is kept."""
    problem = load_problem(EXAMPLES / f"{name}.toml")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in SEEDS:
            path = Path(folder) / f"{seed}.toml"
            path.write_text(problem_to_toml(problem.with_(**{"run.seed": seed})), "utf-8")
            kept = DESIGNS / name if seed == SEEDS[0] else Path(folder) / str(seed)
            rows.append(_design(name, run_design(path, kept), other))
    return [row for same in zip(*rows, strict=True) for row in _median(same)]


def _median(rows: Sequence[Row]) -> Iterator[Row]:
    """Yield the row of the median of some values; of the least and the greatest, too, where they differ."""
    least, *_, greatest = values = sorted(row.value for row in rows)
    yield replace(rows[0], value=median(values))
    if least < greatest:
        yield Row(f"  least of {len(SEEDS)} seeds", least, rows[0].unit)
        yield Row(f"  greatest of {len(SEEDS)} seeds", greatest, rows[0].unit)


def _design(name: str, run: DesignRun, other: dict[str, float]) -> list[Row]:
    """Return the rows of one design."""
    metrics = run.metrics
    return [
        Row(f"{name}: process start to verified result", run.seconds, "s", THESIS_SECONDS, SECONDS[name]),
        *_light(name, metrics, other),
        Row(f"{name}: degrees of freedom", metrics["dof"], "", "thesis 2180"),
        Row(f"{name}: evaluations of loss and gradient", metrics["evaluations"], "", "thesis 1500"),
        Row(f"{name}: landing points, independent trace", run.checks[LANDING], "mm", "", 1e-8),
        Row(f"{name}: irradiance, independent trace", run.checks[IRRADIANCE], "", "", 1e-6),
    ]


def _other_ways(folder: Path) -> Row:
    """Return what the light by other ways than front and rear costs a finished design."""
    system = ResultFolder(folder).read().system
    backend = load_backend("double")
    screen = system.target.screen()
    nonsequential_light(system, screen, backend)  # compiles the kernels
    seconds = median_seconds(lambda: nonsequential_light(system, screen, backend), 3)
    return Row("extended: light by other ways, time", seconds, "s", "", 15)


def _source_image(folder: Path) -> list[Row]:
    """Return how far rays through front and rear are from the source's image that points of the target see.

    One pixel of each of BLOCKS x BLOCKS blocks is compared.  Norms are relative to that of the target.
    """
    system = ResultFolder(folder).read().system
    screen, rng = system.target.screen(), np.random.default_rng(0)
    light, _ = ray_irradiance(system, system.path, screen, load_backend("double"))
    target = system.target.irradiance(screen, light.on_target + light.off_target)
    blocks = np.argwhere(np.ones((BLOCKS, BLOCKS))) + rng.random((BLOCKS**2, 2))
    pixels = (blocks * np.divide(screen.shape, BLOCKS)).astype(int)
    exact, error = pixel_irradiance(SourceImage(Scene.of(system, system.designed)), pixels, screen, GAUSS)
    own, spread = (image[tuple(pixels.T)] for image in (light.irradiance, light.error))
    norm = float(np.sqrt(np.mean(target**2)))
    name = f"extended, front and rear, {BLOCKS**2} pixels against the source's image"
    return [
        Row(f"{name}: error of the irradiance by rays", float(np.sqrt(np.mean((own - exact) ** 2))) / norm),
        Row(f"{name}: the same as the replicates state it", float(np.sqrt(np.mean(spread**2))) / norm),
        Row(
            f"{name}: difference of the flux on all of them",
            float(abs((own - exact).sum()) / exact.sum()),
            "",
            f"rays: +-{np.linalg.norm(spread) / exact.sum():.2g}",
        ),
        Row(
            f"{name}: error of the source's image",
            float(np.sqrt(np.mean(error**2))) / norm,
            "",
            "",
            1e-3,
        ),
    ]


def _without_finish(folder: Path) -> list[Row]:
    """Return the rows of extended_two with many rays, but a level less on both surfaces and no finish."""
    problem = load_problem(EXAMPLES / "extended_two.toml")
    front, rear = (
        replace(surface, freeform=replace(surface.freeform, max_level=surface.freeform.max_level - 1))
        for surface in (problem.lens.front, problem.lens.rear)
    )
    lens = replace(problem.lens, front=front, rear=rear)
    problem = replace(problem, lens=lens, optimizer=replace(problem.optimizer, finish=0))
    path = folder / "short.toml"
    path.write_text(problem_to_toml(problem), "utf-8")
    run = run_design(path, folder / "short", must_pass=False)
    name = "extended_two, a level less, no finish"
    metrics = run.metrics
    return [
        Row(f"{name}: process start to verified result", run.seconds, "s"),
        *_light(name, metrics),
        Row(f"{name}: misfit on the optimiser's rays", metrics["fit"]),
        Row(f"{name}: misfit on other rays", metrics["fresh_fit"]),
    ]


def _light(name: str, metrics: dict[str, Any], other: dict[str, float] | None = None) -> list[Row]:
    """Return rel_l2 and fluxes; limits are those of another design."""
    limits = other or {"rel_l2": None, "lit": None}
    count = metrics["nonsequential"]
    return [
        rel_l2_row(f"{name}: rel_l2, {counted_ways(metrics)}", metrics, "", limits["rel_l2"]),
        Row(
            f"{name}: the same without noise",
            metrics["rel_l2_debiased"],
            limit=WITHOUT_NOISE.get(name),
        ),
        Row(
            f"{name}:    its standard error, relative",
            metrics["rel_l2_error"] / metrics["rel_l2"],
            "",
            "",
            0.02,
        ),
        Row(f"{name}: rel_l2, front and rear only", metrics["rel_l2_sequential"]),
        Row(f"{name}: error of the measured irradiance", metrics["rel_l2_floor"]),
        Row(f"{name}: light on the target by other ways", count["by_other_ways"]),
        Row(
            f"{name}: flux on the lit region, non-sequential",
            count["lit_w"],
            "W",
            THESIS_FLUX,
            limits["lit"],
            ">=",
        ),
        Row(f"{name}: flux on the lit region, front and rear only", count["lit_direct_w"], "W"),
        Row(f"{name}: flux on the target, non-sequential", count["target_w"], "W"),
    ]


def _adam(system: optics.System) -> tuple[list[Row], dict[str, float]]:
    """Return the rows of the thesis's method, and its error and flux as limits of the designs."""
    start = perf_counter()
    *_, batch = adam_batches(system, BOTH_FILTERED)
    seconds = perf_counter() - start
    metrics = system.measure(batch.lens).metrics
    name = "6 batches of 250 Adam steps"
    dof = Row(f"{name}: degrees of freedom", batch.sag.space.dim, "", "thesis 2180")
    limits = {"rel_l2": metrics["rel_l2"], "lit": metrics["nonsequential"]["lit_w"]}
    return [
        Row(f"{name}: optimisation alone", seconds, "s", THESIS_SECONDS),
        *_light(name, metrics),
        dof,
    ], limits


def _batches(system: System, backend: Backend, path: Path) -> list[Row]:
    """Return the irradiance of every batch's STEP file by the independent tracer against the optimiser's
    tracer at equal rays."""
    out = []

    def check(state: State) -> None:
        lens = system.base.with_sags(state.sags)
        write_step(lens, path)
        checks = {c.name: c.value for c in verify(system, StepFile(path), backend)}
        out.append(
            Row(
                f"extended, batch {len(out) + 1}: irradiance of its STEP, independent trace",
                checks[IRRADIANCE],
                "",
                "",
                1e-6,
            )
        )

    shape_lens(system, backend, ExactEngine(backend), listener=Listener(checkpoint=check))
    return out
