"""Writes one result, in an order in which no file ever claims what is not so.

Claims of an earlier result go first, then come problem, lens and solid, then the new claims, and the record
last.
"""

import csv
import io
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from optics.designing.optimisation import Row
from optics.exchange.results.identity import data_of, fingerprint, run_id, stored_name, stored_text
from optics.exchange.results.owned_files import HASHES, hashes, recorded, sha256_of
from optics.exchange.results.result_files import CLAIMS, RECORD, is_level_file, is_result_file, shape_file
from optics.exchange.results.result_folder import ResultFolder
from optics.scene.problem import Problem
from optics.scene.system import System
from thbcad.io import json_text, lens_to_dict, write_bytes, write_lens, write_text

SCHEMA, VERSION = "thbcad-result", 1


class ResultWriter:
    """The files of one run; `run` and `problem_text` are there behind `write_design`.

    folder : taken by this run.  system : of the problem with every "auto" resolved.
    """

    def __init__(self, folder: ResultFolder, system: System) -> None:
        self._folder, self._lens, self._system = folder.path, folder.lens, system
        self._written = set[str]()
        self._earlier = recorded(self._folder / RECORD)
        for name in (*CLAIMS, *filter(is_level_file, self._earlier)):
            (self._folder / name).unlink(missing_ok=True)

    def write_design(self, history: Sequence[Row]) -> None:
        """Write what was asked and what was found: from here on the claims speak of this run."""
        problem, lens = self._system.problem, self._system.designed
        # the resolved problem with its files, so that it can be run again
        for table, _, path in data_of(problem):
            self.write(stored_name(table, path), Path(path).read_bytes())
        self.problem_text = stored_text(problem)
        self.write("problem.toml", self.problem_text.encode())
        write_lens(lens, self._lens)
        self._written.add(self._lens.name)
        for optic, shape in self._system.free_others:
            self.write(shape_file(optic.called), json_text(lens_to_dict(shape)).encode())
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["level", "dof", "evaluation", "loss", "fit", "stage", "fresh_fit"])
        writer.writerows([r.level, r.dof, r.evaluation, r.loss, r.fit, r.stage, r.fresh_fit] for r in history)
        self.write("history.csv", text.getvalue().encode())
        self.run = {"run_id": run_id(problem, lens, (shape for _, shape in self._system.free_others))}

    def staged(self, name: str) -> Path:
        """Return where another process may write a solid; `place_steps` puts it into its place."""
        return self._folder / f".{name}.{os.getpid():08}"

    def place_steps(self, names: Iterable[str]) -> None:
        """Put staged solids into their places; from here on the claims speak of lens.step."""
        for name in names:
            os.replace(self.staged(name), self._folder / name)
            self._written.add(name)
        self.run = self.run | {"step_sha256": sha256_of(self._folder / "lens.step")}

    def write(self, name: str, data: bytes) -> None:
        """Write a file of the result.

        Raises ValueError : a name that no result has, whose replacement nobody was asked about.
        """
        if not is_result_file(name):
            raise ValueError(f"{name} is no file of a result")
        (self._folder / name).parent.mkdir(exist_ok=True)
        write_bytes(self._folder / name, data)
        self._written.add(name)

    def write_claims(self, name: str, data: dict[str, Any]) -> dict[str, Any]:
        """Write a JSON file that says of which run and which solid it speaks, and return what it holds."""
        data = self.run | data
        self.write(name, json_text(data).encode())
        return data

    def finish(self, asked: Problem, verdict: dict[str, Any]) -> None:
        """Write the record, and remove what only an earlier result had.

        asked : the problem as it was read.
        """
        for name in self._earlier.keys() - self._written:
            path = self._folder / name  # a record is data: it may say anything
            if is_result_file(name) and path.exists() and sha256_of(path) == self._earlier[name]:
                path.unlink()
        files = hashes(self._folder, self._written)
        record = {"schema": SCHEMA, "version": VERSION, **self.run, "asked": fingerprint(asked), **verdict}
        write_text(self._folder / RECORD, json_text(record | {HASHES: files}))
