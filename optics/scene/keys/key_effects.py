"""Refuse keys that have no effect in a problem, because another key rules them out."""

from __future__ import annotations

from dataclasses import Field, fields, is_dataclass
from typing import Any

from optics.base.runtime import UserError
from optics.scene.keys.dotted_keys import Record
from optics.scene.keys.toml_text import toml_value


def require_effects(record: Record, prefix: str = "", root: Record | None = None) -> None:
    """Refuse a key that differs from its default where it has no effect, in a record and all its tables.

    `option(only={...})` of a field names the keys that decide, and their values with which the field has an
    effect: keys of the same table, or with a dot those of the whole file.

    prefix : of the names in messages, "" or "table."  root : the record of the whole file; None is this one.

    Raises UserError : names the key, the key that rules it out, and what to do.
    """
    root = root or record
    for f in fields(record):
        value: Any = getattr(record, f.name)
        key = prefix + f.name
        if is_dataclass(value) and not isinstance(value, type):
            require_effects(value, f"{key}.", root)
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            for k, table in enumerate(value):
                name = getattr(table, "name", "")
                place = f"{key}.{name}." if name else f"{key}[{k}]."
                if f.name == "others":  # a file has them in one list with the first: [[source]]
                    place = f"{prefix.removesuffix('.')}[{k + 1}]."
                require_effects(table, place, root)
        if value != f.default:
            _require_effect(key, f, record, prefix, root)


def _require_effect(key: str, field: Field[Any], record: Record, prefix: str, root: Record) -> None:
    for other, found, wanted in _ruling_out(field, record, root):
        name = other if "." in other else prefix + other
        values = " or ".join(toml_value(value) for value in wanted)
        instead = next((f for f in fields(record) if f.name == field.metadata["instead"]), None)
        remedy = f"set {prefix}{instead.name}, " if instead and not _ruling_out(instead, record, root) else ""
        raise UserError(
            f"{key} has no effect with {name} = {toml_value(found)}; leave it out, which is "
            f"{toml_value(field.default)}, {remedy}or set {name} = {values}"
        )


def _ruling_out(field: Field[Any], record: Record, root: Record) -> list[tuple[str, Any, tuple[Any, ...]]]:
    """Return the keys that take the effect of a field away, their values, and those that would not."""
    rows = []
    for other, wanted in field.metadata.get("only", {}).items():
        found: Any = root if "." in other else record
        for part in other.split("."):
            found = getattr(found, part)
        if found not in wanted:
            rows.append((other, found, wanted))
    return rows
