"""Values of JSON files, checked as they are read: nothing but the wanted type passes."""

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from thbcad.checks import Floats, shown
from thbcad.files import regular_bytes
from thbcad.io.atomic_files import write_text
from thbcad.texts import text_of


class RepeatedKey(ValueError):
    """A key that stands twice in an object of a JSON file."""


def write_json(data: object, path: str | Path) -> None:
    """Write plain data to a file, atomically; numbers read back to the same bits."""
    write_text(path, json.dumps(data, separators=(",", ":"), allow_nan=False))


def read_json(path: str | Path, content: str) -> Any:
    """Return the data of a JSON file.

    content : what the file should be, for the message.

    Raises OSError : it cannot be read, or is no regular file.
    Raises ValueError : it is no JSON text, or an object has a key twice.
    """
    try:
        text = text_of(regular_bytes(path))
    except ValueError as error:
        raise ValueError(f"{path} is not a {content} file: {error}") from None
    try:
        return json.loads(text, object_pairs_hook=_once)
    except (json.JSONDecodeError, RepeatedKey) as error:
        raise ValueError(f"{path} is not a {content} file: {error}") from None
    except ValueError:  # of int(), on more digits than it takes
        raise ValueError(f"{path} is not a {content} file: it holds an integer of too many digits") from None
    except RecursionError:
        raise ValueError(f"{path} is not a {content} file: it is nested too deeply") from None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object; raise RepeatedKey for a key that stands twice."""
    table = dict(pairs)
    if len(table) < len(pairs):
        keys = [key for key, _ in pairs]
        raise RepeatedKey(f"its key {shown(next(key for key in table if keys.count(key) > 1))} stands twice")
    return table


def require_keys(data: dict[str, Any], known: Collection[str], content: str) -> None:
    """Raise ValueError for a key that the reader would pass over."""
    for key in data.keys() - known:
        raise ValueError(f"the {content} file has the unknown key {shown(key)}")


def require_schema(data: object, schema: str, version: int, content: str) -> dict[str, Any]:
    """Return the object with this schema and version, or raise ValueError."""
    if not isinstance(data, dict) or data.get("schema") != schema:
        raise ValueError(f"not a {content} file: its schema is not {schema!r}")
    if type(data.get("version")) is not int or data["version"] != version:
        raise ValueError(
            f"{content} file version {shown(data.get('version'))} is unknown, this program reads version "
            f"{version}"
        )
    return data


def a_number(data: dict[str, Any], key: str) -> float:
    """Return the number under a key."""
    return float(a_row([data[key]], key)[0])


def a_row(values: object, key: str) -> Floats:
    """Return a list of JSON numbers as floats; nothing else passes for a number."""
    if not isinstance(values, list) or not all(type(v) in (int, float) for v in values):
        raise ValueError(f"the file's {key} must hold numbers only")
    try:
        return np.array(values, dtype=np.float64)
    except OverflowError:
        raise ValueError(f"the file's {key} holds a number that float64 cannot hold") from None


def cells(values: object, key: str) -> list[Any]:
    """Return a list of lists of JSON integers, cells (i, j); nothing else passes for an integer."""
    rows = values if isinstance(values, list) else [values]
    if not all(isinstance(row, list) and all(type(n) is int for n in row) for row in rows):
        raise ValueError(f"the file's {key} must hold lists of cells [i, j] of integers")
    return rows


def a_list(data: dict[str, Any], key: str) -> list[Any]:
    """Return the list under a key."""
    if not isinstance(data[key], list):
        raise ValueError(f"the file's {key} must be a list")
    result: list[Any] = data[key]
    return result


def a_table(data: dict[str, Any], key: str) -> dict[str, Any]:
    """Return the object under a key."""
    if not isinstance(data[key], dict):
        raise ValueError(f"the file's {key} must be an object")
    result: dict[str, Any] = data[key]
    return result
