"""What a limit of manufacture costs the light."""

from __future__ import annotations

from dataclasses import dataclass

from optics.scene.limits.misses import Miss

COSTS = "costs the light"  # in every sentence, by which a verdict finds it
LEAST = 0.01  # of rel_l2: less is no cost
TIMES = 2.0  # the rel_l2 without the limit: less is within what an optimiser mends
DIGITS = 4  # of the value that the light needs


@dataclass(frozen=True)
class LimitCost:
    """The rel_l2 of a surface with one limit and without it.

    miss : how far the surface without the limit misses it; its extreme is taken where light goes.
    kept, free : rel_l2 with the limit and without it.
    """

    miss: Miss
    kept: float
    free: float

    @property
    def counts(self) -> bool:
        """Whether the limit costs light at all."""
        return costs_light(self.kept, self.free)

    @property
    def sentence(self) -> str:
        """What the limit costs, in words."""
        key, unit, wanted = self.miss.key, self.miss.unit, self.miss.wanted
        kept, free = (f"{max(value, LEAST):.2g}" for value in (self.kept, self.free))
        less = "below " if self.free < LEAST else ""
        return (
            f"limits.{key} = {wanted:g} {unit} {COSTS}: the start has a rel_l2 of {kept} with it and "
            f"{less}{free} without it; the light asks for {self.miss.got:.{DIGITS}g} {unit}"
        )


def costs_light(kept: float, free: float) -> bool:
    """Return whether a rel_l2 that keeps a limit is so much worse than one without it that it counts."""
    return kept > max(LEAST, TIMES * free)
