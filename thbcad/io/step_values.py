"""Values of STEP entities, checked as they are read: references, lists, reals, points, knots, words."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain

import numpy as np

from thbcad.checks import Floats
from thbcad.io.step_text import REAL, STRING, Entity, Reference, Typed, Value, having
from thbcad.splines import KnotVector

Entities = Mapping[int, Entity]
Header = Mapping[str, Sequence[Value]]
NO_HEADER: Header = {}
SCHEMA_NAME = re.compile(r"(\w+)\W.*", re.ASCII | re.DOTALL)
LABELS = {  # what words and numbers beside the shape say, and the entity in which they stand
    "product": "PRODUCT",
    "material": "DESCRIPTIVE_REPRESENTATION_ITEM",
    "density": "MEASURE_REPRESENTATION_ITEM",
    "unit of density": "DERIVED_UNIT_ELEMENT",
    "uncertainty": "UNCERTAINTY_MEASURE_WITH_UNIT",
    "person": "PERSON",
    "company": "ORGANIZATION",
}
POINTS = {
    dimensions: re.compile(
        rf"CARTESIAN_POINT\s*+\(\s*+{STRING}\s*+,\s*+\(\s*+"
        + r"\s*+,\s*+".join([f"({REAL})"] * dimensions)
        + r"\s*+\)\s*+\)\s*+",
        re.ASCII,
    )
    for dimensions in (2, 3)
}
WORDS = {2: "two", 3: "three"}


def direction_of(entities: Entities, value: Value, user: Entity, dimensions: int = 3) -> Floats:
    """Return the two or three components of a DIRECTION, of any length."""
    direction = entity_of(entities, value, user)
    row = reals_of(direction.parameters("DIRECTION", 2)[1], direction)
    if len(row) != dimensions or not np.isfinite(row).all() or not any(row):
        raise ValueError(
            f"STEP entity #{direction.number} must have {WORDS[dimensions]} finite components, not all zero"
        )
    return np.array(row)


def spline_row(entity: Entity, what: str, count: int) -> list[Value]:
    """Return the parameters of a spline as those of the simple form, also where a complex one splits them."""
    base = f"B_SPLINE_{what}"
    with_knots = f"B_SPLINE_{what}_WITH_KNOTS"
    row = entity.parts[with_knots]
    if base in entity.parts:
        row = [None, *entity.parts[base], *row]
    if len(row) != count:
        raise ValueError(
            f"STEP entity #{entity.number}: {with_knots} must have {count} parameters, got {len(row)}"
        )
    return row


def knots_of(entity: Entity, degree: Value, times: Value, values: Value) -> KnotVector:
    """Return the knot vector of distinct knots and how often each occurs."""
    counts = list_of(times, entity)
    knots = reals_of(values, entity)
    # no knot occurs more often than degree + 1 times, so that repeating them takes little memory
    whole = [n for n in [degree, *counts] if type(n) is int and 1 <= n <= 11]
    if len(whole) != 1 + len(counts) or len(counts) != len(knots):
        raise ValueError(
            f"STEP entity #{entity.number} must have as many multiplicities, from 1 to 11, as knots"
        )
    try:
        return KnotVector(whole[0], np.repeat(knots, whole[1:]))
    except ValueError as error:
        raise ValueError(f"STEP entity #{entity.number}: {error}") from None


def net_of(value: Value, knots: Sequence[KnotVector], entity: Entity) -> list[list[Value]]:
    """Return rows of poles or weights, as many as the knots want."""
    rows = [list_of(line, entity) for line in list_of(value, entity)]
    wanted = (knots[0].dim, knots[1].dim)
    widths = {len(line) for line in rows}
    if len(rows) != wanted[0] or widths != {wanted[1]}:
        got = f"{len(rows)} x {' or '.join(map(str, sorted(widths)[:3]))}"
        raise ValueError(
            f"STEP entity #{entity.number} must have {wanted[0]} x {wanted[1]} poles by its knots, got {got}"
        )
    return rows


def points_of(entities: Entities, references: Sequence[Value], user: Entity, dimensions: int = 3) -> Floats:
    """Return the coordinates of CARTESIAN_POINTs, (n, dimensions)."""
    points = [entity_of(entities, k, user) for k in references]
    coordinates: list[str] = []
    for point in points:
        found = POINTS[dimensions].fullmatch(point.text)
        if found is None:
            raise ValueError(
                f"STEP entity #{point.number} must be a CARTESIAN_POINT of {WORDS[dimensions]} reals, got "
                f"{point.text[:60]!r}"
            )
        coordinates.extend(found.groups())
    rows = np.fromiter(map(float, coordinates), np.float64, len(coordinates)).reshape(-1, dimensions)
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        raise ValueError(
            f"STEP entity #{points[int(np.argmin(finite))].number} has a coordinate that float64 cannot hold"
        )
    return rows


def entity_of(entities: Entities, value: Value, user: Entity) -> Entity:
    if not isinstance(value, Reference) or value not in entities:
        raise ValueError(
            f"STEP entity #{user.number} must refer to an entity of the file, got {str(value)[:40]}"
        )
    return entities[value]


def list_of(value: Value, user: Entity) -> list[Value]:
    if not isinstance(value, list):
        raise ValueError(f"STEP entity #{user.number} must have a list, got {str(value)[:40]}")
    return value


def reals_of(value: Value, user: Entity) -> list[float]:
    values = list_of(value, user)
    reals = [v for v in values if type(v) is float]
    if len(reals) != len(values):
        raise ValueError(f"STEP entity #{user.number} must have a list of reals")
    return reals


def flag_of(value: Value, user: Entity) -> bool:
    if value not in ("T", "F"):
        raise ValueError(f"STEP entity #{user.number} must have .T. or .F., got {str(value)[:40]}")
    return value == "T"


def text_of(value: Value, user: Entity) -> str:
    if not isinstance(value, str):
        raise ValueError(f"STEP entity #{user.number} must have a name, got {str(value)[:40]}")
    return value


def labels_of(entities: Entities, header: Header) -> dict[str, tuple[str, ...]]:
    """Return the words of a file, by what they say."""
    name, _, author, organization, *_ = [*header.get("FILE_NAME", ()), None, None, None, None]
    schemas = [*header.get("FILE_SCHEMA", ()), None][0]
    return {
        "name": _words(name),
        "author": _words(author),
        "organization": _words(organization),
        # what stands behind a schema's name is its number
        "schema": tuple(SCHEMA_NAME.sub(r"\1", word) for word in _words(schemas)),
        **{
            label: tuple(sorted(chain.from_iterable(_plain(e.parts[kind]) for e in having(entities, kind))))
            for label, kind in LABELS.items()
        },
    }


def _words(value: Value) -> tuple[str, ...]:
    """Return the strings of a value, a string or a list of such."""
    values = value if isinstance(value, list) else [value]
    return tuple(v for v in values if isinstance(v, str))


def _plain(values: Sequence[Value]) -> Iterator[str]:
    """Yield the texts and numbers of an entity, but no references."""
    for value in values:
        if isinstance(value, Typed):
            yield from _plain(value.parameters)
        elif isinstance(value, str | float) and value != "":
            yield str(value)
