"""Spaces that put the THB kernel under stress: degrees, depths, uneven spans, offsets, multiple knots, orphan
cells."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thbcad import KnotVector, THBSpace


@dataclass(frozen=True, eq=False)
class Case:
    """One space under stress.  x : the degree, level or decade against which the growth of errors is
    fitted."""

    label: str
    x: float
    space: THBSpace


def clamped(degree: int, breaks: NDArray[np.float64], multiplicity: int = 1) -> KnotVector:
    """Return the clamped knot vector on the given breaks."""
    return KnotVector.clamped(degree, np.repeat(breaks[1:-1], multiplicity), breaks[0], breaks[-1])


def random_breaks(rng: np.random.Generator, spans: int) -> NDArray[np.float64]:
    """Return breaks whose spans have ratios up to 4."""
    return np.r_[0, np.cumsum(rng.uniform(1, 4, spans))]


def graded(rng: np.random.Generator, count: int, decades: float) -> NDArray[np.float64]:
    """Return spans of which the longest is 10^decades times the shortest, in random order."""
    return rng.permutation(10.0 ** -np.r_[0, decades, decades * rng.random(count - 2)])


def corner(kv_u: KnotVector, kv_v: KnotVector, depth: int, width: int) -> THBSpace:
    """Return the space with the lowest width x width cells of every level refined."""
    space = THBSpace(kv_u, kv_v)
    block = np.argwhere(np.ones((width, width)))
    for level in range(depth):
        space = space.refine({level: block})
    return space


def _degrees(rng: np.random.Generator) -> Iterator[Case]:
    for p in range(1, 11):
        kvs = [clamped(p, random_breaks(rng, p + 3)) for _ in range(2)]
        yield Case(f"degree {p}", p, corner(*kvs, 2, p + 1))


def _depths(rng: np.random.Generator) -> Iterator[Case]:
    kv = KnotVector.uniform(3, 8)
    for depth in (1, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20):
        yield Case(f"level {depth}", depth, corner(kv, kv, depth, 4))


def _spacings(rng: np.random.Generator) -> Iterator[Case]:
    for decades in range(9):
        for p in (2, 3, 5, 7):
            kvs = [clamped(p, np.r_[0, np.cumsum(graded(rng, 8, decades))]) for _ in range(2)]
            yield Case(f"ratio 1e{decades}, degree {p}", decades, corner(*kvs, 2, p + 1))


def _offsets(rng: np.random.Generator) -> Iterator[Case]:
    for decades in range(-6, 7, 2):
        for offset in (0.0, 1e6, -1e6):
            size = 10.0**decades
            kvs = [clamped(3, offset + size * random_breaks(rng, 6)) for _ in range(2)]
            yield Case(f"offset {offset:g}, size {size:g}", decades, corner(*kvs, 3, 4))


def _multiples(rng: np.random.Generator) -> Iterator[Case]:
    for p in range(2, 8):
        for multiplicity in sorted({2, p}):
            kvs = [clamped(p, random_breaks(rng, 5), multiplicity) for _ in range(2)]
            yield Case(f"degree {p}, {multiplicity}-fold knots", p, corner(*kvs, 2, 3))


def _orphans(rng: np.random.Generator) -> Iterator[Case]:
    """Lone refined cells, which add no function, and lone cells within them."""
    for p in range(2, 6):
        kvs = [clamped(p, random_breaks(rng, p + 4)) for _ in range(2)]
        space = THBSpace(*kvs).refine({0: [(1, 1), (3, 3)]}).refine({1: [(2, 3)]})
        assert space.dim == THBSpace(*kvs).dim
        yield Case(f"degree {p}", p, space)


STRESSES: tuple[tuple[str, Callable[[np.random.Generator], Iterator[Case]], str], ...] = (
    ("degree 1 to 10", _degrees, "degree"),
    ("corner to level 20", _depths, "level"),
    ("span ratios to 1e8", _spacings, "decade"),
    ("offset and size to 1e6", _offsets, ""),
    ("multiple knots", _multiples, ""),
    ("orphan cells", _orphans, ""),
)
