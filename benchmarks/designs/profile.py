"""Where the seconds of a design go, each beside what the work cannot do without; its memory; checks.

Run: thbcad bench profile
"""

from __future__ import annotations

import cProfile
import pstats
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter, sleep

import numpy as np
import psutil

from benchmarks.checkout import EXAMPLES
from benchmarks.rows.row import Row, median_seconds
from optics.base.runtime import load_backend
from optics.designing.optimisation import stages
from optics.designing.starts import TransportStart
from optics.scene.keys import problem_to_toml
from optics.scene.problem import load_problem
from optics.scene.system import System

PEARL = EXAMPLES / "pearl.toml"
RUNS = 5
MANY = 4096  # pixels of a large target, in each direction
LOOK = 0.05  # seconds between looks at the memory
PACKAGES = "numpy, scipy.fft, scipy.interpolate, scipy.optimize, scipy.sparse, drjit"
PHASE = re.compile(r"^(?P<name>[a-z -]+\d*)(?::.*)?, (?P<seconds>[\d.]+) s \(", re.MULTILINE)
# of 8 bytes for a cell, written and read again: corners and their flux, codes, slopes, what adjoints pass on
NUMBERS = 16


def rows() -> list[Row]:
    """Return the rows of the pearl; seconds are medians."""
    with tempfile.TemporaryDirectory() as folder:
        runs = [_run(Path(folder) / "pearl") for _ in range(RUNS)]
        text = (Path(folder) / "pearl" / "lens.step").read_text("ascii")
    system = System(load_problem(PEARL))
    stage = stages(system, from_transport=True)[-1]
    cells, numbers = stage.rays[0] * stage.rays[1], re.findall(r"[\d.]+E[+-]\d+|\d+\.\d*", text)
    evaluation = 2 * 8 * NUMBERS * cells / _bytes_a_second()
    least = {
        "process and imports": (_imports(), f"a process that imports {PACKAGES}"),
        "start surface": (_transforms(system), "its cosine transforms"),
        f"level {stage.level}": (
            stage.evaluations * evaluation,
            f"memory: {stage.evaluations} times {NUMBERS} numbers a cell, written and read",
        ),
        "export": (
            _seconds(lambda: list(map(repr, map(float, numbers)))),
            f"{len(numbers)} numbers as text",
        ),
        "verify": (_seconds(lambda: list(map(float, numbers))), f"{len(numbers)} numbers from text"),
    }
    until = [sum(run.values()) - run["figures"] for run in runs]
    out = [
        Row("pearl: to the verified STEP", median(until), "s"),
        Row("pearl", median(sum(run.values()) for run in runs), "s"),
    ]
    for name in runs[0]:
        out.append(Row(f"  {name}", median(run[name] for run in runs), "s"))
        if name in least:
            out.append(Row(f"  {name}, at least", least[name][0], "s", least[name][1]))
    return [*out, *_checks(), *_memory()]


def _checks() -> list[Row]:
    """Return the rows of `thbcad check`, of the pearl and of a large target."""
    with tempfile.TemporaryDirectory() as folder:
        large, problem = Path(folder) / "large.toml", load_problem(PEARL)
        target = replace(problem.target, pixels=(MANY, MANY))
        large.write_text(problem_to_toml(replace(problem, target=target)), "utf-8")
        files = {"pearl": PEARL, f"{MANY} x {MANY} pixels": large}
        return [Row(f"check: {name}", _seconds(partial(_check, file)), "s") for name, file in files.items()]


def _check(file: Path) -> None:
    subprocess.run(_words("check", file), check=True, capture_output=True)


def _memory() -> list[Row]:
    """Return the rows of the most memory that a design and its helpers have at one time (Linux)."""
    if sys.platform != "linux":
        return []
    with tempfile.TemporaryDirectory() as folder:
        return [
            Row(
                f"{name}: memory at one time",
                _most_memory(_words("design", PEARL.with_name(f"{name}.toml"), "--out", folder, "--force")),
                "MB",
            )
            for name in ("pearl", "pearl_fine")
        ]


def _most_memory(words: list[str]) -> float:
    """Return the greatest proportional set size of a command with its processes, MB.

    Raises CalledProcessError : the command failed.
    """
    process, most = psutil.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL), 0
    while process.poll() is None:
        now = 0
        with suppress(psutil.Error):  # of the command, which has just ended
            for each in (process, *process.children(recursive=True)):
                with suppress(psutil.Error):  # of a process of its own
                    now += each.memory_full_info().pss
        most = max(most, now)
        sleep(LOOK)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, words)
    return most / 2**20


def _words(*words: object) -> list[str]:
    return [sys.executable, "-m", "optics", *map(str, words)]


def _run(folder: Path) -> dict[str, float]:
    """Return the seconds of each phase of a design, from the start of its process to its end."""
    start, words = perf_counter(), _words("design", PEARL, "--out", folder, "--force")
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    whole = perf_counter() - start
    phases: dict[str, float] = {}
    for found in PHASE.finditer(done.stderr):
        name = "coarser meshes" if found["name"].startswith("mesh") else found["name"]
        phases[name] = phases.get(name, 0.0) + float(found["seconds"])
    return {"process and imports": whole - sum(phases.values())} | phases


def _seconds(work: Callable[[], object]) -> float:
    return median_seconds(work, 3)


def _imports() -> float:
    program = [sys.executable, "-c", f"import {PACKAGES}"]
    return _seconds(lambda: subprocess.run(program, check=True))


def _transforms(system: System) -> float:
    """Return the seconds of the cosine transforms of a transport start."""
    profile = cProfile.Profile()
    profile.runcall(lambda: TransportStart(system, load_backend("double", 1)).fit(system.base.rear.sag.space))
    timed = pstats.Stats(profile).stats.items()  # type: ignore[attr-defined]
    return sum(own for (_, _, name), (_, _, own, _, _) in timed if "dct" in name and "built-in" in name)


def _bytes_a_second() -> float:
    """Return how fast one core reads and writes memory that no cache holds."""
    source = np.ones(1 << 25)
    target = np.empty_like(source)
    return 2 * source.nbytes / median_seconds(lambda: np.copyto(target, source), 7)
