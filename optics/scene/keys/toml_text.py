"""Records as TOML again, with every key."""

from __future__ import annotations

from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

from optics.scene.keys.dotted_keys import Record, hints_of, lists_tables, table_of, variants_of

SHARED = "with the keys of"  # begins the note of a table whose keys stand elsewhere


def problem_to_toml(problem: Record, notes: bool = False) -> str:
    """Return a Problem as TOML with every key, so that a run can be repeated from it.

    notes : whether a comment explains every key.
    """
    return _toml(problem, "", notes).lstrip("\n")


def _toml(record: Record, prefix: str, notes: bool = False) -> str:
    lines: list[str] = []
    tables: list[str] = []
    for f in fields(record):
        value, remark = getattr(record, f.name), _remark(f) if notes else ""
        table = table_of(hints_of(type(record))[f.name])
        is_table = table is not None
        if value is None and (f.default is not None or not is_table):
            lines.append(f"{f.name} = false{remark}\n" if is_table or notes else "")
            continue
        if value is None:
            tables.append(f"\n# [{prefix}{f.name}]{remark}\n{_left_out(f, table)}" if notes else "")
            continue
        if lists_tables(hints_of(type(record))[f.name]):
            head = f"{prefix}{f.name}"
            tables += [f"\n[[{head}]]\n{_toml(table, f'{head}.', notes)}" for table in value]
            empty = notes and not value
            tables.append(f"\n# [[{head}]]{remark}\n{_left_out(f, table)}" if empty else "")
        elif is_dataclass(value) and not isinstance(value, type):
            tables.append(f"\n[{prefix}{f.name}]{remark}\n" + _toml(value, f"{prefix}{f.name}.", notes))
        else:
            lines.append(f"{f.name} = {toml_value(value)}{remark}\n")
    return "".join(lines) + "".join(tables)


def _remark(field: Field[Any]) -> str:
    """Return the comment that explains a key."""
    several = field.metadata["choices"] and len(field.metadata["choices"]) > 1
    choices = " or ".join(map(repr, field.metadata["choices"])) if several else ""
    words = "; ".join(w for w in (field.metadata["note"], choices) if w)
    return f"  # {words}" if words else ""


def _left_out(field: Field[Any], table: type[Record] | None) -> str:
    """Return the keys of a table that is left out, as comments; none of one whose keys stand elsewhere, or
    that has tables itself."""
    if table is None or field.metadata["note"].startswith(SHARED):
        return ""
    hints = hints_of(table)
    own = [f for f in fields(table) if "note" in f.metadata]
    if len(variants_of(table)) > 1 or any(table_of(hints[f.name]) for f in own):
        return ""
    lines = []
    for f in own:
        required = f.default is MISSING and f.default_factory is MISSING
        default = "?" if required else toml_value(f.default)
        lines.append(f"# {f.name} = {default}{_remark(f)}\n")
    return "".join(lines)


def toml_value(value: object) -> str:
    """Return a value as TOML; None, which leaves something out, is false."""
    if value is None:
        return "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return repr(value)
