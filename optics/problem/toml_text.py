"""The problem as a text: TOML with every key, or with comments to start from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

from optics.problem.schema import Freeform, Front, LensSpec, Problem, Rear, Source, Target
from optics.problem.toml_records import AUTO

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def problem_to_toml(problem: Problem) -> str:
    """Return the problem as TOML with every key, so that a run can be repeated from it."""
    return _toml(problem, "").lstrip("\n")


def commented_problem() -> str:
    """Return a problem file to start from: every key with a value and a comment."""
    freeform = Freeform(max_level=AUTO, z_freedom=AUTO)
    example = Problem(
        title="my lens",
        source=Source(kind="collimated", half_width=(47.5, 47.5)),
        lens=LensSpec(
            index=1.5,
            thickness=20.0,
            front=Front(half_width=(50.0, 50.0)),
            rear=Rear(half_width=(50.0, 50.0), radius=AUTO, conic=AUTO, freeform=freeform),
        ),
        target=Target(kind="image", image="picture.png", distance=300.0, half_width=(100.0, 100.0)),
    )
    return _toml(example, "", notes=True).lstrip("\n")


def _toml(record: DataclassInstance, prefix: str, notes: bool = False) -> str:
    lines: list[str] = []
    tables: list[str] = []
    for f in fields(record):
        value = getattr(record, f.name)
        if value is None:
            tables.append(f"\n# [{prefix}{f.name}]{_remark(f.metadata)}\n" if notes else "")
            continue
        if is_dataclass(value) and not isinstance(value, type):
            tables.append(f"\n[{prefix}{f.name}]\n" + _toml(value, f"{prefix}{f.name}.", notes))
        else:
            remark = _remark(f.metadata) if notes else ""
            lines.append(f"{f.name} = {_toml_value(value)}{remark}\n")
    return "".join(lines) + "".join(tables)


def _remark(limits: Mapping[str, Any]) -> str:
    """Return the comment of a key: its note and its choices."""
    several = limits["choices"] and len(limits["choices"]) > 1
    choices = " or ".join(map(repr, limits["choices"])) if several else ""
    words = "; ".join(w for w in (limits["note"], choices) if w)
    return f"  # {words}" if words else ""


def _toml_value(value: object) -> str:
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    return repr(value)
