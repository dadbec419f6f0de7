"""Every combination of the values that a sweep gives to some keys, checked before any of them is designed."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from decimal import Decimal, InvalidOperation
from itertools import product
from math import isfinite, prod
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError
from optics.exchange.results import data_of, fingerprint
from optics.scene.keys import assignment
from optics.scene.problem import Problem

MOST_VALUES = 100_000  # of one key
FILE_KEYS = ("target.image", "source.image", "source.file")  # whose values are paths
MOST = 1_000_000  # variants: their checks alone take half an hour


def value_list(text: str, folder: Path) -> tuple[str, list[Any]]:
    """Return key and values of a text "KEY=START:STOP:COUNT" or "KEY=[VALUE, ...]".

    Both ends of a range belong to it.  A list is TOML, or JSON without null.

    folder : what relative paths of files start from.

    Raises UserError : no "=", an unknown key, values that are neither, such as a list without
        brackets, or of texts without quotes.
    """
    name, _, value = (part.strip() for part in text.partition("="))
    parts = value.split(":")
    try:
        ends = [Decimal(part.strip()) for part in parts] if len(parts) == 3 else []
    except InvalidOperation:
        ends = []
    if ends:
        assignment(f"{name}=[]", Problem)  # refuses an unknown key
        return name, _range(name, *ends)
    try:
        name, found = assignment(text, Problem)
    except UserError:
        if "," not in value or value.startswith("["):
            raise
        assignment(f"{name}=[]", Problem)  # refuses an unknown key
        raise UserError(f"{name}: write several values in brackets, {name}=[{value}], got {value}") from None
    if found == value and value.startswith("["):
        raise UserError(f'{value} is no list for {name}: put texts in quotes, such as {name}=["a", "b"]')
    values = found if isinstance(found, list) else [found]
    return name, [_with_files(name, value, folder) for value in values]


def _with_files(name: str, value: Any, folder: Path) -> Any:
    """Return a value of a key with absolute paths, in tables too."""
    if isinstance(value, dict):
        return {key: _with_files(f"{name}.{key}", one, folder) for key, one in value.items()}
    return (
        str((folder / value).absolute()) if name in FILE_KEYS and isinstance(value, str) and value else value
    )


def _range(name: str, start: Decimal, stop: Decimal, count: Decimal) -> list[Any]:
    """Return evenly spaced numbers, both ends included; whole ones where all of them are written so."""
    if not count.is_finite() or count != count.to_integral_value() or not 1 <= count <= MOST_VALUES:
        raise UserError(f"{name}: the count of a range must be from 1 to {MOST_VALUES}, got {count}")
    if not all(end.is_finite() and isfinite(float(end)) for end in (start, stop)):
        raise UserError(f"{name}: both ends of a range must be finite, got {start}:{stop}")
    if count == 1 and start != stop:
        raise UserError(f"{name}: a range of one value must begin and end with it, got {start}:{stop}:1")
    steps = max(int(count) - 1, 1)
    values = [start + (stop - start) * k / steps for k in range(int(count))]
    whole = all(v == v.to_integral_value() for v in values) and "." not in str(start) + str(stop)
    return [int(value) if whole else float(value) for value in values]


@dataclass(frozen=True)
class Variant:
    """One combination.

    values : in the order of the keys.  identity : fingerprint of its problem, "" where it is none.
    refusal : a sentence that says why it is none, or "".  files : paths of its pictures and rays.
    """

    values: tuple[Any, ...]
    identity: str
    refusal: str = ""
    files: tuple[str, ...] = ()


def checked_ranges(ranges: Mapping[str, Sequence[Any]]) -> dict[str, list[Any]]:
    """Return the values of every key as lists of what JSON holds, which the store and tables keep.

    Numbers of numpy become those of Python, paths become texts, records become dicts, tuples become lists.

    Raises UserError : no key, no list, an empty list, a value that JSON cannot hold, or too many
        combinations.
    """
    if not isinstance(ranges, Mapping) or not ranges:
        raise UserError('a sweep varies at least one key, such as {"target.distance": [200, 300]}')
    lists: dict[str, list[Any]] = {}
    for key, values in ranges.items():
        if not isinstance(key, str):
            raise UserError(f"a sweep varies dotted keys, such as target.distance, got {key!r}")
        if isinstance(values, str | bytes | Mapping) or not hasattr(values, "__iter__"):
            raise UserError(f"{key} must be varied over a list of values, got {values!r}")
        lists[key] = [_plain(key, value) for value in values]
        if not lists[key]:
            raise UserError(f"{key} must be varied over at least one value, got none")
    count = prod(map(len, lists.values()))
    if count > MOST:
        raise UserError(f"a sweep has at most {MOST} variants, these are {count}; leave values out")
    return lists


def all_variants(problem: Problem, ranges: Mapping[str, Sequence[Any]]) -> list[Variant]:
    """Return every combination, the values of the last key changing first.

    Raises UserError : an unknown key, or a value that no combination can have; as `Problem.with_` says it.
    """
    places = list(product(*(range(len(values)) for values in ranges.values())))
    found = [_variant(problem, dict(zip(ranges, values))) for values in product(*ranges.values())]
    for at, key in enumerate(ranges):
        possible = {place[at] for variant, place in zip(found, places) if not variant.refusal}
        for k, value in enumerate(ranges[key]):
            if k not in possible:
                why = next(variant.refusal for variant, place in zip(found, places) if place[at] == k)
                raise UserError(_variant(problem, {key: value}).refusal or why)
    return found


def _plain(key: str, value: Any) -> Any:
    """Return a value as JSON gives it back."""
    try:
        return json.loads(json.dumps(value, default=_for_json))
    except (TypeError, ValueError):
        raise UserError(
            f"{key} must be varied over numbers, texts, paths, lists or tables, got {value!r}"
        ) from None


def _for_json(value: Any) -> Any:
    """Return something that JSON does not know by what it knows."""
    if hasattr(value, "tolist"):  # numbers and arrays of numpy
        return value.tolist()
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else os.fspath(value)


def _variant(problem: Problem, changes: Mapping[str, Any]) -> Variant:
    values = tuple(changes.values())
    try:
        varied = problem.with_(**changes)
        return Variant(values, fingerprint(varied), files=tuple(path for _, _, path in data_of(varied)))
    except UserError as error:
        return Variant(values, "", str(error))
    except OSError as error:
        return Variant(values, "", str(UserError(f"cannot read {error.filename}: {error.strerror}")))
