"""The commands and the calibration loop that an audit runs, each once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from shutil import copyfile
from time import perf_counter, thread_time
from typing import Any

import numpy as np

import thbcad
from optics.base.runtime import POSIX, limited_cores

PROBLEMS = Path(__file__).parent  # where the problem files are
KERNELS = "DRJIT_CACHE_DIR"  # environment variable: the folder of Dr.Jit's compiled kernels
CORES = 2  # of the commands, so that their times mean the same on larger machines
PASSES = 100  # of the calibration loop: a second


class NotTried(Exception):
    """A claim that cannot be measured here; the sentence says what is missing."""


class Unexpected(Exception):
    """A command that did not end as an audit needs it; the sentence says how it ended."""


@dataclass(frozen=True)
class Ended:
    """A command that has ended.

    cpu : seconds of CPU of the command and of its helper processes, user and system.  wall : seconds.
    loop : CPU seconds of the calibration loop, mean of one before and one after; 0 where it was not run.
    """

    words: tuple[str, ...]
    code: int
    out: str
    err: str
    cpu: float = 0.0
    wall: float = 0.0
    loop: float = 0.0

    @property
    def ratio(self) -> float:
        """CPU seconds of the command / CPU seconds of the calibration loop."""
        return self.cpu / self.loop

    def data(self, *codes: int) -> dict[str, Any]:
        """Return what the command printed as JSON.

        Raises Unexpected : it did not end with one of these exit codes.
        """
        if self.code not in codes:
            said = (self.err.strip().splitlines() or ["it said nothing"])[-1]
            raise Unexpected(f"thbcad {' '.join(self.words)} ended with exit code {self.code}: {said}")
        found: dict[str, Any] = json.loads(self.out)
        return found


def calibration_loop() -> float:
    """Run a fixed mix of work on one core and return its seconds of CPU.

    Each pass counts 40 000 remainders in a dictionary, as the interpreter does its own work, and sorts and
    transforms 256 x 256 numbers by numpy.
    """
    start = thread_time()
    counts: dict[int, int] = {}
    numbers = np.random.default_rng(0).random((256, 256))
    for _ in range(PASSES):
        for k in range(40_000):
            rest = k * k % 1009
            counts[rest] = counts.get(rest, 0) + 1
        numbers = np.abs(np.fft.ifft2(np.fft.fft2(np.sort(numbers, axis=0)))) + np.sqrt(numbers)
    return thread_time() - start


@dataclass(frozen=True, eq=False)
class Experiments:
    """What the claims of an audit look at: commands, each of which runs once, and files in a folder.

    folder : empty; the problem files are copied into it, and commands run in it.
    kernels : empty; the commands keep their compiled kernels there, in place of the user's.
    """

    folder: Path
    kernels: Path
    _ended: dict[tuple[str, ...], Ended] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for problem in PROBLEMS.glob("*.toml"):
            copyfile(problem, self.folder / problem.name)

    def design(self, name: str) -> Ended:
        """Return the design of the square into a folder of this name, with its times."""
        return self._run(("design", "square.toml", "--out", name, "--json"), timed=True)

    def command(self, *words: str) -> Ended:
        """Return how a command of thbcad ended."""
        return self._run(words)

    def _run(self, words: tuple[str, ...], timed: bool = False) -> Ended:
        if words not in self._ended:
            self._ended[words] = self._timed(words) if timed else self._called(words)
        return self._ended[words]

    def _timed(self, words: tuple[str, ...]) -> Ended:
        before, cpu, start = calibration_loop(), _cpu_of_children(), perf_counter()
        ended = self._called(words)
        wall = perf_counter() - start
        spent = _cpu_of_children() - cpu if POSIX else wall  # Windows does not count it
        loop = (before + calibration_loop()) / 2
        return Ended(ended.words, ended.code, ended.out, ended.err, spent, wall, loop)

    def _called(self, words: tuple[str, ...]) -> Ended:
        """Run a command of this very package in a process of its own; it ends where this one is stopped."""
        package = str(Path(thbcad.__file__).parents[1])
        paths = os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH"))))
        process = subprocess.Popen(
            [sys.executable, "-m", "thbcad", *words],
            cwd=self.folder,
            env=os.environ | {"PYTHONPATH": paths, KERNELS: str(self.kernels), "PYTHONIOENCODING": "utf-8"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
        )
        try:
            out, err = process.communicate()
        except BaseException:
            process.terminate()
            process.communicate()
            raise
        return Ended(words, process.returncode, out, err)


@contextmanager
def experiments_in(place: Path) -> Iterator[Experiments]:
    """Yield Experiments in folders of an empty folder, on two cores.

    In the block Dr.Jit keeps its kernels there too where this process loads it.
    """
    place = place.resolve()  # commands run in another folder
    folder, kernels = place / "audit", place / "kernels"
    folder.mkdir()
    with limited_cores(CORES), _kernels_in(kernels):
        yield Experiments(folder, kernels)


@contextmanager
def _kernels_in(folder: Path) -> Iterator[None]:
    before = os.environ.get(KERNELS)
    os.environ[KERNELS] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[KERNELS]
        else:
            os.environ[KERNELS] = before


def _cpu_of_children() -> float:
    times = os.times()
    return times.children_user + times.children_system
