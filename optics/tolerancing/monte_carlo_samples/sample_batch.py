"""What became of many Monte Carlo samples: how good their light is, and how well that is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from thbcad.checks import Floats

CONFIDENCE = 0.95
LEAST: Final = "inverted_cdf"  # quantile: the least value that a part of all does not exceed
SHOWN = (0.05, 0.5, 0.95)  # parts of all lenses that are no worse than the quantile


@dataclass(frozen=True)
class Range:
    """A result, and the interval that holds the true one with CONFIDENCE."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class SampleBatch:
    """The light of Monte Carlo samples, lenses made with errors, in independent sets of the same size.

    rel_l2, efficiency, made : (sets, lenses), inf, 0 and 0 of lenses that could not be traced.
    min_over_mean : the same, of uniform light, NaN where it is unknown; None of other light.
    made : the verdict on the light: 1 where it is made, 0 where it misses, NaN where rays do not tell.
    failures : the different sentences why not.
    seconds : of all traces together.
    """

    rel_l2: Floats
    efficiency: Floats
    made: Floats
    failures: tuple[str, ...] = ()
    seconds: float = 0.0
    min_over_mean: Floats | None = None

    def quantile(self, part: float) -> Range:
        """Return the least rel_l2 that so large a part of all lenses does not exceed."""
        value = float(np.quantile(self.rel_l2, part, method=LEAST))
        return self._around(value, np.quantile(self.rel_l2, part, axis=1, method=LEAST))

    def mean_square(self) -> Range:
        """Return the mean of rel_l2^2."""
        sets = np.square(self.rel_l2).mean(axis=1)
        return self._around(float(sets.mean()), sets)

    def keeping(self, bounds: Mapping[str, float]) -> Range:
        """Return the part of all lenses that keep limits: of rel_l2 at most, of other numbers at least.

        bounds : of "rel_l2", "efficiency" and "min_over_mean".
        """
        kept = np.ones(self.rel_l2.shape, bool)
        for name, bound in bounds.items():
            values = getattr(self, name)
            kept &= values <= bound if name == "rel_l2" else values >= bound
        return self._part(kept)

    @property
    def good(self) -> Range:
        """The yield: the part of all lenses whose light is known to keep the limits of the problem.

        The interval holds whatever becomes of those that are undecided.
        """
        known, possible = self._part(self.made == 1), self._part(self.made != 0)
        return Range(known.value, known.low, possible.high)

    @property
    def undecided(self) -> float:
        """The part of all lenses of which rays do not tell whether they keep these limits."""
        return float(np.isnan(self.made).mean())

    def _part(self, kept: NDArray[np.bool_]) -> Range:
        """Return the part of lenses that are kept.

        The interval is that of the sets' spread (Student's t); of sets that agree it is Wilson's, which holds
        for independent lenses.
        """
        sets = kept.mean(axis=1)
        found = self._around(float(sets.mean()), sets)
        if found.low == found.high:
            test = stats.binomtest(int(kept.sum()), kept.size)
            wilson = test.proportion_ci(CONFIDENCE, method="wilson")
            return Range(found.value, float(wilson.low), float(wilson.high))
        return Range(found.value, max(found.low, 0.0), min(found.high, 1.0))

    def nearest(self, part: float) -> tuple[int, int]:
        """Return set and number of the lens that is the quantile."""
        value = np.quantile(self.rel_l2, part, method=LEAST)
        row, column = np.argwhere(self.rel_l2 == value)[0]
        return int(row), int(column)

    def data(self, bounds: Mapping[str, float]) -> dict[str, Any]:
        """Return it as numbers by name.  bounds : see `keeping`."""
        finite = self.efficiency[np.isfinite(self.rel_l2)]
        return {
            "samples": int(self.rel_l2.size),
            "sets": len(self.rel_l2),
            "confidence": CONFIDENCE,
            "rel_l2_rms": sqrt(self.mean_square().value),
            "rel_l2": {f"{part:.0%}": asdict(self.quantile(part)) for part in SHOWN},
            "efficiency_mean": float(finite.mean()) if finite.size else 0.0,
            "efficiency_least": float(finite.min()) if finite.size else 0.0,
            "yield": asdict(self.good),
            "undecided": self.undecided,
            "limits": dict(bounds),
            "yield_by_limits": asdict(self.keeping(bounds)),
            "yield_by_limit": {name: asdict(self.keeping({name: bounds[name]})) for name in bounds},
            "not_traced": int((~np.isfinite(self.rel_l2)).sum()),
            "failures": list(self.failures),
        }

    def _around(self, value: float, sets: Floats) -> Range:
        """Return the interval of a result whose values of every set are known."""
        if not np.isfinite(sets).all():
            return Range(value, float(sets.min()), np.inf)
        wide = stats.t.ppf((1 + CONFIDENCE) / 2, len(sets) - 1) * sets.std(ddof=1) / sqrt(len(sets))
        return Range(value, value - float(wide), value + float(wide))
