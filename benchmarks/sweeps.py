"""Sweeps: workers beside each other, the cost of one variant, and what a killed process costs.

Run: thbcad bench sweeps
"""

from __future__ import annotations

import time
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from unittest.mock import patch

import numpy as np

from benchmarks.checkout import EXAMPLES
from benchmarks.rows.row import Row
from optics.base.runtime import ProgressEvent
from optics.interface.sweeps import Designed, Shared, Sweep, Work, sweep
from optics.scene.problem import load_problem
from oracles.sweep_programs import DISTANCES, Cluster, children, kill, some_stored, start_sweep, stored

PROBLEM = EXAMPLES / "tophat_circle.toml"
VARIANTS = 15
MANY, PAUSE, WORKERS = 10_000, 0.01, 2  # variants that do nothing for so many seconds
EARLY = 0.2  # of all variants: from where on memory shall not grow


def rows() -> list[Row]:
    """Return the measured rows."""
    return [*_beside_each_other(), *_overhead(), *_kills()]


def _beside_each_other() -> list[Row]:
    """Return the times of whole sweeps on one worker and on two."""
    seconds, found = zip(*(_distances(workers) for workers in (1, 2)))
    peak = max(row.peak_mb for swept in found for row in swept.rows)
    alone, both = (sum(row.seconds for row in swept.rows) for swept in found)
    name = f"round top hat, {VARIANTS} distances"
    return [
        Row(f"{name}: one worker", seconds[0], "s", f"{alone:.1f} s of it in designs"),
        Row("   two workers", seconds[1], "s", f"{both:.1f} s in designs, side by side"),
        Row("   two workers, how many times faster", seconds[0] / seconds[1], "", "", 1.7, ">="),
        Row("   most memory of a worker", peak, "MB", "", 1500),
    ]


def _distances(workers: int) -> tuple[float, Sweep]:
    with TemporaryDirectory() as folder:
        start = perf_counter()
        ranges = {"target.distance": np.linspace(200, 400, VARIANTS)}
        found = sweep(load_problem(PROBLEM), ranges, folder, workers=workers)
        seconds = perf_counter() - start
    if found.counts()["done"] != VARIANTS:
        raise ValueError(f"not all variants were designed: {found.counts()}")
    return seconds, found


def idle(shared: Shared, work: Work) -> Designed:
    """Do nothing for a while, in place of a design."""
    time.sleep(PAUSE)
    return Designed({"rel_l2": work.changes["target.distance"]}, b"", "")


def _overhead() -> list[Row]:
    """Return what a variant costs beside its own time, and how much the client grows."""
    memory: list[float] = []
    ranges = {"target.distance": np.linspace(200, 400, MANY)}
    problem, show = load_problem(PROBLEM), partial(_sample, memory=memory)
    with TemporaryDirectory() as folder, patch("optics.interface.sweeps.running.designed", idle):
        start = perf_counter()
        found = sweep(problem, ranges, folder, WORKERS, progress=show)
        seconds = perf_counter() - start
    if found.counts()["done"] != MANY:
        raise ValueError(f"not all variants were computed: {found.counts()}")
    each = (seconds - MANY * PAUSE / WORKERS) / MANY
    workers = [row.peak_mb for row in found.rows]
    early = round(EARLY * MANY)
    grown = max(workers) - max(workers[:early])
    return [
        Row(f"{MANY} variants of {PAUSE:g} s on {WORKERS} workers", seconds, "s", "checks and tables too"),
        Row("   overhead of each", 1e3 * each, "ms", "beyond the time of the workers", 5),
        Row(f"   growth of the client behind the first {early}", memory[-1] - memory[early], "MB", "", 20),
        Row(f"   growth of the workers behind the first {early}", grown, "MB", "", 20),
    ]


def _sample(event: ProgressEvent, memory: list[float]) -> None:
    if event.phase == "variants":
        pages = int(Path("/proc/self/statm").read_text("utf-8").split()[1])
        memory.append(pages * 4096 / 2**20)


def _kills() -> list[Row]:
    """Return the rows that are lost or missing after kill -9 of a worker, the client and the scheduler."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        out = [_killed(f"{who}, own processes", folder / who, None) for who in ("worker", "client")]
        for who in ("worker", "client", "scheduler") if find_spec("distributed") else ():
            (folder / f"{who}_dask").mkdir()
            cluster = Cluster(folder / f"{who}_dask")
            try:
                out.append(_killed(f"{who}, dask", folder / f"{who}_out", cluster))
            finally:
                cluster.stop()
    return out


def _killed(name: str, out: Path, cluster: Cluster | None) -> Row:
    """Kill a process in mid-sweep, go on, and return how many rows were computed again or are missing."""
    means = ["--scheduler", cluster.address] if cluster else ["--workers", "2"]
    process = start_sweep(out, *means)
    some_stored(out, process)
    before = stored(out)
    if name.startswith("client"):
        kill(process.pid)
    elif name.startswith("scheduler") and cluster:
        kill(cluster.scheduler.pid)
    else:
        kill(cluster.worker_processes()[0] if cluster else children(process.pid)[0])
    process.communicate()
    start_sweep(out, "--workers", "2", "--resume").communicate()
    after = stored(out)
    lost = sum(after.get(changes) != seconds for changes, seconds in before.items())
    lines = (out / "sweep.csv").read_text("utf-8").count(",done,")
    return Row(f"kill -9 of {name}: rows lost or missing", lost + DISTANCES - lines, "", "", 0)
