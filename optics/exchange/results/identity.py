"""Which problem, and which run: texts and hashes that tell them apart."""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import Field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from optics.base.runtime import require_regular_file
from optics.exchange.results.owned_files import sha256_of
from optics.scene.keys import problem_to_toml
from optics.scene.problem import Export, Problem, Verify
from thbcad.io import lens_to_dict
from thbcad.lens import Lens

OF_THE_LIGHT = (
    *("min_over_mean", "min_over_max", "rsd"),
    *("rel_l2", "contrast_error", "lit_efficiency", "stray", "beam_angle", "field_angle"),
)  # keys of verify
KEPT = "result"  # default of run.keep
# defaults of earlier versions, whose results are still read
EARLIER = {"optimizer.iterations": (60,), "run.precision": "double"}
DATA = ("target", "source")  # tables that may name a file: a picture, or rays


def fingerprint(problem: Problem) -> str:
    """Return a hash that differs between problems: of their values and of the content of their files.

    It does not depend on the paths of the files, nor on the number of threads and on what is kept of
    levels.

    Raises UserError : a file that is a folder, a pipe or a device.  Raises OSError : it cannot be read.
    """
    files = {f"{table}.{part.data}": _hash_of(Path(path)) for table, part, path in data_of(problem)}
    return _sha256(_set_keys(problem, {"run.threads": 0, "run.keep": KEPT, **files}))


def _hash_of(path: Path) -> str:
    """Return the hash of a file that a problem names.  Raises UserError : a pipe or a device has no end."""
    if path.exists():
        require_regular_file(path)
    return sha256_of(path)


def run_id(problem: Problem, lens: Lens, others: Iterable[Lens] = ()) -> str:
    """Return the hash of a resolved problem and the lens, and other free elements, made for it.

    Pictures and rays do not count: the run's record holds the hashes of the files.  Nor do the table export
    and the limits of the light: names in CAD files, and what light will do, may be changed after a design.
    """
    files = {f"{table}.{part.data}": table for table, part, _ in data_of(problem)}
    limits = {f"verify.{f.name}": f.default for f in fields(Verify) if f.name in OF_THE_LIGHT}
    shapes = "".join(json.dumps(lens_to_dict(shape)) for shape in (lens, *others))
    return _sha256(_set_keys(replace(problem, export=Export()), {**files, **limits}) + shapes)


def differing_keys(mine: Any, other: Any, prefix: str = "") -> Iterator[str]:
    """Yield the keys in which two problems differ, but for paths of files, threads and what is kept."""
    for field in fields(mine):
        key, a, b = f"{prefix}{field.name}", getattr(mine, field.name), getattr(other, field.name)
        if is_dataclass(a) and is_dataclass(b):
            yield from differing_keys(a, b, f"{key}.")
        elif a != b and field.name not in ("image", "file") and key not in ("run.threads", "run.keep"):
            yield key


def _set_keys(problem: Problem, others: Mapping[str, object] | None = None) -> str:
    """Return the keys that differ from their first defaults, a line each.

    So keys that a later version knows too do not change what is known of a problem.

    others : values in place of the problem's own, by dotted key.
    """
    return "\n".join(f"{key} = {value!r}" for key, value in _set(problem, others or {}))


def _set(table: Any, others: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    for field in fields(table):
        key = f"{prefix}{field.name}"
        value = others.get(key, getattr(table, field.name))
        if is_dataclass(value):
            yield from _set(value, others, f"{key}.")
        elif value != EARLIER.get(key, _left_out(table, field)):
            yield key, value


def _left_out(table: Any, field: Field[Any]) -> Any:
    """Return what a key of a table stands for where nothing is said of it, which others may decide."""
    if field.default is not None:
        return field.default
    return getattr(replace(table, **{field.name: None}), field.name)


def data_of(problem: Problem) -> list[tuple[str, Any, str]]:
    """Return (name, table, path) of the problem's tables that name a file."""
    tables = [(name, getattr(problem, name)) for name in DATA]
    named = [(name, table, getattr(table, table.data)) for name, table in tables]
    return [(name, table, path) for name, table, path in named if path]


def stored_name(table: str, path: str) -> str:
    """Return what the file of a table is called in a result folder."""
    return table + Path(path).suffix.lower()


def stored_text(problem: Problem) -> str:
    """Return the problem file of a result folder, which has the files that it names beside it."""
    tables = {
        name: replace(table, **{table.data: stored_name(name, path)})
        for name, table, path in data_of(problem)
    }
    return problem_to_toml(replace(problem, **tables))


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()
