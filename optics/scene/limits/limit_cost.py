"""What a limit of manufacture costs the light."""

from __future__ import annotations

import re
from dataclasses import dataclass

from optics.scene.limits.misses import Miss

NAMED = re.compile(r"limits\.\w+ = \S+ \S+ (costs|may cost) the light: ")  # how every sentence begins
LEAST = 0.01  # of rel_l2: less is no cost
TIMES = 2.0  # the rel_l2 without the limit: less is within what an optimiser mends
DIGITS = 4  # of the value that the light needs


@dataclass(frozen=True)
class LimitCost:
    """The rel_l2 of a surface with one limit and without it.

    miss : how far the surface without the limit misses it; its extreme is taken where light goes.
    kept, free : rel_l2 with the limit and without it; None where they are not known.
    surface : the noun of the surface.
    """

    miss: Miss
    kept: float | None
    free: float | None
    surface: str = "the start"

    @property
    def counts(self) -> bool:
        """Whether the limit costs light at all."""
        return self.kept is None or self.free is None or costs_light(self.kept, self.free)

    @property
    def sentence(self) -> str:
        """What the limit costs, in words."""
        limit = f"limits.{self.miss.key} = {self.miss.wanted:g} {self.miss.unit}"
        got = f"{self.miss.got:.{DIGITS}g} {self.miss.unit}"
        if self.kept is None or self.free is None:
            return f"{limit} may cost the light: without it {self.surface} has {got}"
        kept, free = (f"{max(value, LEAST):.2g}" for value in (self.kept, self.free))
        less = "below " if self.free < LEAST else ""
        return (
            f"{limit} costs the light: {self.surface} has a rel_l2 of {kept} with it and "
            f"{less}{free} without it; the light asks for {got}"
        )


def active_sentence(key: str, wanted: float, unit: str) -> str:
    """Return what a limit may cost the light of a design that ends at it, in words."""
    return f"limits.{key} = {wanted:g} {unit} may cost the light: the design ends at this limit"


def names_cost(note: str) -> bool:
    """Return whether a note is the sentence of a LimitCost, or of a limit at which a design ends."""
    return NAMED.match(note) is not None


def costs_light(kept: float, free: float) -> bool:
    """Return whether a rel_l2 that keeps a limit is so much worse than one without it that it counts."""
    return kept > max(LEAST, TIMES * free)
