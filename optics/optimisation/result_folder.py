"""The result folder: what a run writes, and how it is read back."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optics.optimisation.stage_plan import stages
from optics.optimisation.state import Row, State
from optics.problem import Problem, load_problem, problem_to_toml
from optics.runtime import UserError
from thbcad.io import json_text, read_lens, sag_from_dict, sag_to_dict, write_bytes, write_lens, write_text

if TYPE_CHECKING:
    from optics.system import OpticalSystem
    from thbcad.lens import Lens

CHECKPOINT = "checkpoint.json"
CHECKED = ("metrics.json", "verify.json", "manufacture.json")
FILES = ("problem.toml", "lens.json", "lens.step", *CHECKED, "history.csv", "report.html", CHECKPOINT)
VERSION = 3


def writable_folder(path: Path) -> None:
    """Make a folder and see that it can be written, before any work is done.

    Raises
    ------
    UserError : it cannot.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path) as probe:
            probe.write(b"0")
    except OSError as error:
        raise UserError(
            f"cannot write to the result folder {path}: {error.strerror}; choose another with --out"
        ) from None


def require_writable(path: Path) -> None:
    """Raise UserError unless a file can be written there, before any work is done."""
    reason = "it is a folder" if path.is_dir() else ""
    if not path.parent.is_dir():
        reason = f"there is no folder {path.parent}"
    try:
        if not reason:
            with tempfile.TemporaryFile(dir=path.parent) as probe:
                probe.write(b"0")
    except OSError as error:
        reason = str(error.strerror)
    if reason:
        raise UserError(f"cannot write {path}: {reason}; choose another --out")


def lens_of(path: Path, advice: str) -> Lens:
    """Return the lens of a native file.

    Raises
    ------
    UserError : it cannot be read, which ends with the advice, or it is damaged.
    """
    try:
        return read_lens(path)
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}; {advice}") from None
    except ValueError as error:
        raise UserError(f"{path}: {error}") from None


class ResultFolder:
    """Paths and files of one run.  Files appear whole or not at all.

    Raises
    ------
    UserError : the folder cannot be made or written.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.step = self.path / "lens.step"
        self.lens = self.path / "lens.json"
        self.problem = self.path / "problem.toml"
        self.figures = self.path / "figures"

    def prepare(self) -> None:
        """Make the folder and see that it can be written, before any work is done."""
        writable_folder(self.path)
        writable_folder(self.figures)
        for name in FILES:
            if (self.path / name).is_dir():
                raise UserError(
                    f"cannot write {self.path / name}: it is a folder; move it or choose another with --out"
                )

    def write_problem(self, problem: Problem) -> None:
        """Store the resolved problem and its pictures, so that the problem can be run again."""
        names = {}
        for table in ("target", "source"):
            part = getattr(problem, table)
            if part.image:
                picture = Path(part.image)
                names[table] = replace(part, image=table + picture.suffix.lower())
                copy = self.path / names[table].image
                if picture.resolve() != copy.resolve():
                    write_bytes(copy, picture.read_bytes())
        problem = replace(problem, **names)
        write_text(self.problem, problem_to_toml(problem))

    def read_problem(self) -> Problem:
        if not self.problem.exists():
            raise UserError(f"{self.path} is not a result folder: it has no problem.toml")
        return load_problem(self.problem)

    def write_lens(self, lens: Lens) -> None:
        write_lens(lens, self.lens)

    def read_lens(self) -> Lens:
        return lens_of(self.lens, "was the design interrupted?")

    def write_json(self, name: str, data: dict[str, Any]) -> None:
        write_text(self.path / name, json_text(data))

    def write_history(self, history: Sequence[Row]) -> None:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["level", "dof", "evaluation", "loss", "fit", "seconds", "fresh_fit"])
        for r in history:
            writer.writerow([r.level, r.dof, r.evaluation, r.loss, r.fit, f"{r.seconds:.4f}", r.fresh_fit])
        write_text(self.path / "history.csv", text.getvalue())

    def write_checkpoint(self, problem: Problem, state: State) -> None:
        """Store a run's state.  It names the problem, so that no other can go on from it."""
        data = {
            "schema": "thbcad-checkpoint",
            "version": VERSION,
            "problem": _fingerprint(problem),
            "moved": state.moved,
            "stage": state.stage,
            "sags": [sag_to_dict(sag) for sag in state.sags],
            "history": [list(asdict(row).values()) for row in state.history],
        }
        write_text(self.path / CHECKPOINT, json.dumps(data, separators=(",", ":"), allow_nan=False))
        self.write_history(state.history)

    def read_checkpoint(self, system: OpticalSystem) -> State:
        """Return the State to go on from.

        Raises
        ------
        UserError : there is none, it is damaged, or it belongs to another problem.
        """
        path = self.path / CHECKPOINT
        try:
            data = json.loads(path.read_text("utf-8"))
            if data["schema"] != "thbcad-checkpoint" or data["version"] != VERSION:
                raise ValueError("unknown schema or version")
            same = data["problem"] == _fingerprint(system.problem)
            state = _state(data)
        except OSError as error:
            raise UserError(
                f"nothing to resume: cannot read {path}: {error.strerror}; run without --resume"
            ) from None
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise UserError(f"cannot resume: {path} is damaged ({error}); run without --resume") from None
        if not same:
            raise UserError(
                f"cannot resume: {path} belongs to another problem; run without --resume or change --out"
            )
        last, count = len(stages(system, state.moved)), len(system.freeforms)
        damage = ""
        if not 0 <= state.stage <= last:
            damage = f"stage {state.stage} of at most {last}"
        elif len(state.sags) != count:
            damage = f"{len(state.sags)} sags instead of {count}"
        if damage:
            raise UserError(f"cannot resume: {path} is damaged ({damage}); run without --resume")
        return state

    def has_checkpoint(self) -> bool:
        return (self.path / CHECKPOINT).exists()

    def drop_checkpoint(self) -> None:
        """Remove the checkpoint of a finished run."""
        (self.path / CHECKPOINT).unlink(missing_ok=True)


def _state(data: dict[str, Any]) -> State:
    """Return the State of a checkpoint's data; ValueError where an entry is not what was written."""
    moved, stage, history = data["moved"], data["stage"], tuple(Row(*row) for row in data["history"])
    if type(moved) is not bool or type(stage) is not int:
        raise ValueError("moved must be true or false and stage a whole number")
    for row in history:
        numbers = [v for name, v in asdict(row).items() if v is not None or name != "fresh_fit"]
        if not all(type(v) in (int, float) for v in numbers):
            raise ValueError("the history must hold numbers")
    return State(moved, stage, tuple(sag_from_dict(sag) for sag in data["sags"]), history)


def _fingerprint(problem: Problem) -> str:
    """Return a text that differs between problems: their values and the content of their pictures.

    It does not depend on the paths of the pictures.
    """
    parts = {table: getattr(problem, table) for table in ("target", "source")}
    hashed = {
        table: replace(part, image=hashlib.sha256(Path(part.image).read_bytes()).hexdigest())
        for table, part in parts.items()
        if part.image
    }
    return problem_to_toml(replace(problem, run=replace(problem.run, threads=0), **hashed))
