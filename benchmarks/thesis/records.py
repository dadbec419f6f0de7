"""Runs of a study, and what they found: one file per run, so that an ended set of runs can go on."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from benchmarks.thesis.pages import Section
from thbcad.io import json_text, write_bytes

Arrays = Mapping[str, NDArray[Any]]
Numbers = Mapping[str, Any]  # what JSON holds: numbers, words, and lists of them

NUMBERS = "numbers"  # the array of a file that holds them, as JSON


@dataclass(frozen=True, eq=False)
class Found:
    """What a run found: numbers for the tables and verdicts, arrays for the pictures."""

    numbers: Numbers
    arrays: Arrays = field(default_factory=dict)


Results = Mapping[str, Found]  # by the names of the runs of one study


@dataclass(frozen=True, eq=False)
class Run:
    """One run of a study: its name, and the function that makes it from the runs before it."""

    name: str
    make: Callable[[Results], Found]


class Study(Protocol):
    """A module of one study of the thesis."""

    NUMBER: int
    TITLE: str

    def runs(self, quick: bool) -> list[Run]: ...

    def section(self, results: Results) -> Section:
        """Return what the page says, from the numbers alone."""
        ...

    def pictures(self, results: Results) -> Iterator[tuple[str, bytes]]:
        """Yield the name and the PNG of every picture that `section` shows."""
        ...


class RunFolder:
    """The files of the runs of one study."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def clear(self) -> None:
        """Remove the files of all runs."""
        for path in self._folder.glob("*.npz"):
            path.unlink()

    def read(self, names: list[str]) -> dict[str, Found]:
        """Return what is there of the runs with these names, in their order."""
        found = ((name, self._path(name)) for name in names)
        return {name: _read(path) for name, path in found if path.exists()}

    def write(self, name: str, found: Found) -> None:
        """Keep what a run found, atomically."""
        buffer = io.BytesIO()
        np.savez_compressed(
            buffer, **{NUMBERS: np.array(json_text(dict(found.numbers)))}, **dict(found.arrays)
        )
        self._folder.mkdir(parents=True, exist_ok=True)
        write_bytes(self._path(name), buffer.getvalue())

    def _path(self, name: str) -> Path:
        return self._folder / f"{name.replace(' ', '_').replace('/', '-')}.npz"


def completed(study: Study, quick: bool, folder: RunFolder) -> dict[str, Found]:
    """Return the results of all runs of a study; those that are in the folder are not run again."""
    runs = study.runs(quick)
    results = folder.read([run.name for run in runs])
    for k, run in enumerate(runs, 1):
        if run.name in results:
            continue
        print(f"study {study.NUMBER}, run {k} of {len(runs)}: {run.name}", file=sys.stderr, flush=True)
        wall, cpu = perf_counter(), process_time()
        found = run.make(results)
        times = {"seconds": perf_counter() - wall, "cpu_seconds": process_time() - cpu}
        results[run.name] = Found({**found.numbers, **times}, found.arrays)
        folder.write(run.name, results[run.name])
    return {run.name: results[run.name] for run in runs}


def _read(path: Path) -> Found:
    with np.load(path, allow_pickle=False) as data:
        arrays = {key: data[key] for key in data.files if key != NUMBERS}
        return Found(json.loads(str(data[NUMBERS])), arrays)
