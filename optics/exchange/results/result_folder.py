"""The result folder: where a run writes, what it may replace, and how a result is read back.

A result is one thing.  Its record `result.json` is written last and holds the hash of every other file; a
folder without it, or with files that it does not speak of, is not a result.
"""

import csv
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

from optics.base.runtime import UserError
from optics.designing.optimisation import Row
from optics.exchange.results.checkpoint import checkpoint_owner
from optics.exchange.results.folder_lock import require_no_run, run_lock
from optics.exchange.results.identity import DATA, differing_keys, fingerprint, run_id, stored_text
from optics.exchange.results.owned_files import (
    HASHES,
    LIVE,
    recorded,
    remove_live_page,
    require_own,
    require_places,
    sha256_of,
    writable_folder,
)
from optics.exchange.results.result_files import (
    CHECKED,
    CHECKPOINT,
    FILES,
    FILES_OF_A_LEVEL,
    RECORD,
    is_level_file,
    is_result_file,
    level_files,
    part_files,
    pictures_of,
    shape_file,
)
from optics.scene.keys import AUTO
from optics.scene.problem import Problem, load_problem
from optics.scene.system import System
from thbcad.files import regular_bytes
from thbcad.io import read_json, read_lens
from thbcad.lens import Lens
from thbcad.texts import text_of

KEYS_SHOWN = 4  # in which two problems differ; files that are named


class Result(NamedTuple):
    """A whole result, read back."""

    system: System
    record: dict[str, Any]

    @property
    def lens(self) -> Lens:
        return self.system.designed

    @property
    def problem(self) -> Problem:
        return self.system.problem


class ResultFolder:
    """The folder of one result.  Files appear whole or not at all."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.step = self.path / "lens.step"
        self.lens = self.path / "lens.json"
        self.problem = self.path / "problem.toml"
        self.checkpoint = self.path / CHECKPOINT

    @contextmanager
    def taken(self, problem: Problem, force: bool) -> Iterator[None]:
        """Hold the folder for one run; it is made, and taken away again where nothing was written.

        A run that fails or is stopped leaves no half-written file.

        Raises UserError : it cannot be written, another run writes to it, or, without `force`, something
            would be lost: files that this program did not write, the result or unfinished run of another
            problem.
        """
        new = not self.path.exists()
        writable_folder(self.path)
        try:
            with run_lock(self.path, problem.title):
                self._clear_temporaries()
                require_places(self.path, self._names(problem))
                if not force:
                    self._require_nothing_lost(problem)
                remove_live_page(self.path)
                try:
                    yield
                except BaseException:
                    with suppress(OSError):  # what happened is told, not that
                        self._clear_temporaries()
                    raise
        finally:
            if new and not any(self.path.iterdir()):
                self.path.rmdir()

    def read(self, taken: bool = False) -> Result:
        """Return the result.  taken : by the run that reads it.

        Raises UserError : it is not whole, a file is damaged, or files of several runs lie here.
        """
        if self.path.is_file():
            raise UserError(
                f"{self.path} is not a result folder but a file; of a lens in STEP or lens.json one is made "
                f"by `thbcad design PROBLEM.toml --lens {self.path}`"
            )
        if not taken:
            require_no_run(self.path)
        if not self.problem.exists():
            if self.checkpoint.exists():
                raise UserError(
                    f"the design in {self.path} was stopped; end it by its problem file and --resume"
                )
            raise UserError(f"{self.path} is not a result folder: it has no problem.toml")
        record, problem, lens = self._record(), load_problem(self.problem), self.read_lens()
        shapes = self.read_shapes(problem)
        if record["run_id"] != run_id(problem, lens, shapes.values()):
            made = ("problem.toml", "lens.json", *map(shape_file, shapes))
            changed = [name for name in made if not self._is_recorded(name)]
            if not changed:
                raise UserError(
                    f"{self.path} is the result of a version of thbcad whose problem files had other keys; "
                    "run the design again, or use lens.json and lens.step by themselves"
                )
            raise UserError(
                f"{self.path} holds no single result: {' and '.join(changed)} changed since the run that "
                f"{RECORD} speaks of; run the design again, or put the file back"
            )
        # a file that is there and speaks of another run
        names = [name for name in self._record()[HASHES] if is_result_file(name) and name not in FILES]
        wrong = [name for name in names if (self.path / name).exists() and not self._is_recorded(name)]
        for name in CHECKED:
            try:
                data = read_json(self.path / name, "result")
            except (OSError, ValueError, RecursionError):
                continue  # it claims nothing
            if not isinstance(data, dict) or data.get("run_id") != record["run_id"]:
                wrong.append(name)
        if wrong:
            raise UserError(
                f"{self.path} holds no single result: {', '.join(wrong)} belongs to another run than "
                f"{RECORD}; run the design again"
            )
        return Result(System(problem, shapes=shapes).with_lens(lens), record)

    def read_lens(self) -> Lens:
        return lens_of(self.lens, "was the design interrupted? its --resume ends it")

    def read_shapes(self, problem: Problem) -> dict[str, Lens]:
        """Return the shapes of the free elements by name, but for that of lens.json."""
        names = [optic.called for optic in problem.free_optics if optic is not problem.optic]
        return {name: lens_of(self.path / shape_file(name), "run the design again") for name in names}

    def found_shapes(self) -> dict[str, Lens]:
        """Return the same of the files that lie here, also of a run that was interrupted."""
        files = {path.name.partition(".")[0]: path for path in self.path.glob(shape_file("*"))}
        return {name: lens_of(path, "run the design again") for name, path in files.items()}

    def read_history(self) -> tuple[Row, ...]:
        """Return the rows of history.csv; the time of an evaluation is not kept, it reads as 0.

        Raises UserError : it is missing, or is not that of the result.
        """
        self.require_recorded(["history.csv"])
        text = text_of(regular_bytes(self.path / "history.csv"))
        return tuple(_row(**row) for row in csv.DictReader(text.split("\n")))

    def kept_levels(self) -> list[tuple[str, str, str]]:
        """Return the files of the levels that the record speaks of, as `level_files`."""
        return level_files(sum(map(is_level_file, self._record()[HASHES])) // FILES_OF_A_LEVEL)

    def require_recorded(self, names: Iterable[str]) -> None:
        """Raise UserError unless files are there, and as the record says."""
        wrong = [name for name in names if not self._is_recorded(name)]
        if wrong:
            raise UserError(
                f"{self.path} is no whole result: {', '.join(wrong[:KEYS_SHOWN])} is missing or changed "
                f"since the run that {RECORD} speaks of; run the design again, or put the file back"
            )

    def has_result(self) -> bool:
        return (self.path / RECORD).exists()

    def is_result_of(self, problem: Problem) -> bool:
        """Return whether a finished result of the problem lies here, be it as asked for or as resolved."""
        try:
            asked = self._record().get("asked")
            return fingerprint(problem) in (asked, fingerprint(load_problem(self.problem)))
        except (UserError, OSError):
            return False

    def has_run_of(self, problem: Problem) -> bool:
        """Return whether an unfinished run of the problem lies here."""
        owner = checkpoint_owner(self.checkpoint)
        return owner is not None and fingerprint(problem) in owner.problems

    def owns(self, name: str) -> bool:
        """Return whether a file of this name is one of the result that lies here."""
        return self.has_result() and (name in FILES or name in recorded(self.path / RECORD))

    def _record(self) -> dict[str, Any]:
        path = self.path / RECORD
        try:
            record: dict[str, Any] = read_json(path, "record")
            kinds = {HASHES: dict, "run_id": str, "ok": bool, "verdict": str}
            if not all(isinstance(record[key], kind) for key, kind in kinds.items()):
                raise ValueError
            return record
        except OSError as error:
            raise UserError(
                f"{self.path} holds no finished result: cannot read {path} ({error.strerror}), which a run "
                f"writes last; run the design again, or give {self.step} or {self.lens} by itself"
            ) from None
        except (ValueError, KeyError, TypeError, RecursionError):
            raise UserError(f"{path} is damaged; run the design again") from None

    def _is_recorded(self, name: str) -> bool:
        path, held = self.path / name, self._record()[HASHES]
        return path.exists() and held.get(name) == sha256_of(path)

    def _clear_temporaries(self) -> None:
        """Remove what a killed run left of half-written files."""
        for name in (*FILES, CHECKPOINT, LIVE, "*.step", shape_file("*"), *(f"{stem}.*" for stem in DATA)):
            folder, _, last = name.rpartition("/")
            for pattern in (f".{last}.????????", f"..{last}.????????.????????"):
                for path in (self.path / folder).glob(pattern):
                    path.unlink(missing_ok=True)

    def _names(self, problem: Problem) -> list[str]:
        """Return what a run of the problem may write."""
        kept = [path.relative_to(self.path).as_posix() for path in self.path.glob("**/level_*")]
        levels = [name for name in kept if is_level_file(name)]
        return [*FILES, CHECKPOINT, *pictures_of(problem), *part_files(problem), *levels]

    def require_kept(self, asked: Path) -> None:
        """Raise UserError where the result would replace the problem file that is asked for, which is not its
        own: beside an unfinished run nobody knows whose it is, and comments would be lost."""
        if not self.problem.exists() or not self.problem.samefile(asked):
            return
        if self.has_result() and self._is_recorded(self.problem.name):
            return
        if stored_text(load_problem(asked)) != text_of(regular_bytes(asked)):
            raise UserError(
                f"{asked} would be replaced by the resolved problem, without its comments; choose another "
                "--out, or replace it with --force"
            )

    def _require_nothing_lost(self, problem: Problem) -> None:
        names = self._names(problem)
        if self.has_run_of(problem):
            if self.has_result():
                names.remove(CHECKPOINT)
                require_own(self.path, names, RECORD, force=False)
            return  # whose files lie here was asked when that run began
        if owner := checkpoint_owner(self.checkpoint):
            raise UserError(
                f"{self.path} holds an unfinished run of another problem, {owner.title!r}, which would be "
                "lost: go on with it by its problem file and --resume, choose another --out, or drop it with "
                "--force"
            )
        if self.has_result() and not self.is_result_of(problem):
            self._refuse_another_problem(problem)
        require_own(self.path, names, RECORD, force=False)

    def _refuse_another_problem(self, problem: Problem) -> None:
        """Raise UserError that says in which keys the problem of the result differs, if it can be read."""
        try:
            other = load_problem(self.problem)
        except UserError:
            return  # its files are looked at one by one
        keys = [key for key in differing_keys(problem, other) if attrgetter(key)(problem) != AUTO]
        shown = ", ".join(keys[:KEYS_SHOWN]) + (" and more" if len(keys) > KEYS_SHOWN else "")
        raise UserError(
            f"{self.path} holds the result of another problem, {other.title!r}, which would be lost (it "
            f"differs in {shown or 'a picture, or its record is damaged'}); choose another --out, or replace "
            "it with --force"
        )


def _row(fresh_fit: str, loss: str, fit: str, **whole: str) -> Row:
    counts = {name: int(number) for name, number in whole.items()}
    fresh = float(fresh_fit) if fresh_fit else None
    return Row(loss=float(loss), fit=float(fit), seconds=0.0, fresh_fit=fresh, **counts)


def lens_of(path: Path, advice: str) -> Lens:
    """Return the lens of a native file.

    Raises UserError : it cannot be read, which ends with the advice, or it is damaged.
    """
    try:
        return read_lens(path)
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}; {advice}") from None
    except ValueError as error:
        raise UserError(f"{path}: {error}") from None
