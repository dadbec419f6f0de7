"""Records as TOML again, with every key."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

from optics.scene.keys.dotted_keys import Record, hints_of, lists_tables, table_of


def problem_to_toml(problem: Record, notes: bool = False) -> str:
    """Return a Problem as TOML with every key, so that a run can be repeated from it.

    notes : whether a comment explains every key.
    """
    return _toml(problem, "", notes).lstrip("\n")


def _toml(record: Record, prefix: str, notes: bool = False) -> str:
    lines: list[str] = []
    tables: list[str] = []
    for f in fields(record):
        several = f.metadata["choices"] and len(f.metadata["choices"]) > 1
        choices = " or ".join(map(repr, f.metadata["choices"])) if several else ""
        words = "; ".join(w for w in (f.metadata["note"], choices) if w)
        value, remark = getattr(record, f.name), f"  # {words}" if notes and words else ""
        is_table = table_of(hints_of(type(record))[f.name]) is not None
        if value is None and (f.default is not None or not is_table):
            lines.append(f"{f.name} = false{remark}\n" if is_table or notes else "")
            continue
        if value is None:
            tables.append(f"\n# [{prefix}{f.name}]{remark}\n" if notes else "")
            continue
        if lists_tables(hints_of(type(record))[f.name]):
            head = f"{prefix}{f.name}"
            tables += [f"\n[[{head}]]\n{_toml(table, f'{head}.', notes)}" for table in value]
            tables.append(f"\n# [[{head}]]{remark}\n" if notes and not value else "")
        elif is_dataclass(value) and not isinstance(value, type):
            tables.append(f"\n[{prefix}{f.name}]{remark}\n" + _toml(value, f"{prefix}{f.name}.", notes))
        else:
            lines.append(f"{f.name} = {_toml_value(value)}{remark}\n")
    return "".join(lines) + "".join(tables)


def _toml_value(value: object) -> str:
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    return repr(value)
