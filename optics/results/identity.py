"""Which problem, and which run: texts and hashes that tell them apart."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optics.problem import Export, Problem, problem_to_toml
from thbcad.io import lens_to_dict

if TYPE_CHECKING:
    from thbcad.lens import Lens

KEPT = "result"  # default of run.keep
PICTURES = ("target", "source")  # tables with a picture


def fingerprint(problem: Problem) -> str:
    """Return a hash that differs between problems: of their values and of the content of their pictures.

    It does not depend on the paths of the pictures, nor on the number of threads and on what is kept of
    levels.
    """
    parts = {
        table: replace(part, image=hashlib.sha256(Path(part.image).read_bytes()).hexdigest())
        for table, part in _pictured(problem)
    }
    return _sha256(problem_to_toml(replace(problem, run=replace(problem.run, threads=0, keep=KEPT), **parts)))


def run_id(problem: Problem, lens: Lens) -> str:
    """Return the hash of a resolved problem and the lens made for it.

    Pictures do not count: the run's record holds the hashes of the files.  Nor does the table export: the
    names in CAD files may be changed after a design.
    """
    parts = {table: replace(part, image=table) for table, part in _pictured(problem)}
    return _sha256(
        problem_to_toml(replace(problem, export=Export(), **parts)) + json.dumps(lens_to_dict(lens))
    )


def differing_keys(mine: Any, other: Any, prefix: str = "") -> Iterator[str]:
    """Yield the keys in which two problems differ, but for paths of pictures, threads and what is kept."""
    for field in fields(mine):
        key, a, b = f"{prefix}{field.name}", getattr(mine, field.name), getattr(other, field.name)
        if is_dataclass(a) and is_dataclass(b):
            yield from differing_keys(a, b, f"{key}.")
        elif a != b and field.name != "image" and key not in ("run.threads", "run.keep"):
            yield key


def _pictured(problem: Problem) -> list[tuple[str, Any]]:
    """Return (name, table) of the problem's tables that name a picture."""
    tables = [(name, getattr(problem, name)) for name in PICTURES]
    return [(name, table) for name, table in tables if table.image]


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()
