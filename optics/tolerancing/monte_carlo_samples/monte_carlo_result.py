"""Monte Carlo samples of a design beside what single tolerances let expect."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any

from numpy.typing import NDArray

from optics.tolerancing.monte_carlo_samples.sample_batch import CONFIDENCE, SHOWN, SampleBatch
from optics.tolerancing.monte_carlo_samples.sampling import ErrorModel, Sampled
from optics.tolerancing.perturbations import ToleranceBudget, limit_words


@dataclass(frozen=True, eq=False)
class MonteCarlo:
    """Monte Carlo samples of a design.

    sampled : what they deliver, and their errors.  model : how these are drawn.
    budget : of the same tolerances, one at a time, whose limits a good lens keeps.
    """

    sampled: Sampled
    model: ErrorModel
    budget: ToleranceBudget

    @property
    def batch(self) -> SampleBatch:
        return self.sampled.batch

    @property
    def form_rise(self) -> float:
        """The mean rise of rel_l2^2 by the forms alone."""
        square = self.sampled.by_form
        return 0.0 if square is None else max(square - self.budget.rel_l2**2, 0.0)

    def irradiance(self, part: float) -> NDArray[Any]:
        """Return the light of the lens that a part of all lenses is better than, (rows, columns)."""
        row, column = self.batch.nearest(part)
        return self.model.irradiance(self.sampled.sets[row][column])

    def shares(self) -> dict[str, float]:
        """Return the share of each tolerance, and of the forms, in the expected rise of rel_l2^2.

        Errors anywhere within +- their amount: the mean rise is a third of that at the amount.
        """
        rises = {e.tolerance.name: max(e.rise, 0.0) / 3 for e in self.budget.effects}
        if self.model.forms:
            rises[" and ".join(form.name for form in self.model.forms)] = self.form_rise
        total = sum(rises.values()) or 1.0
        return dict(sorted(((n, r / total) for n, r in rises.items()), key=lambda row: -row[1]))

    @property
    def expected(self) -> float:
        """rel_l2, root mean square, as rises of single errors add up."""
        return sqrt(max(self.budget.expected**2 + self.form_rise, 0.0))

    def data(self) -> dict[str, Any]:
        """Return it as numbers by name, for tolerance.json."""
        forms = {
            form.name: {"rms_nm": 1e6 * form.rms, "periods_mm": list(form.band)} for form in self.model.forms
        }
        return {
            **self.batch.data(self.budget.bounds),
            "forms": forms,
            "expected_rel_l2": self.expected,
            "shares": self.shares(),
        }

    def sentences(self) -> list[str]:
        """Return what to expect of a batch."""
        batch = self.batch
        median, worst = (batch.quantile(part) for part in SHOWN[1:])
        bounds, good = self.budget.bounds, batch.good
        kept, each = batch.keeping(bounds), {name: batch.keeping({name: bounds[name]}) for name in bounds}
        alone = "; ".join(f"{name} alone {part.value:.1%}" for name, part in each.items())
        the = "" if self.model.system.problem.element else "the "
        make = "are known to make" if batch.undecided else "make"
        lines = [
            f"{batch.rel_l2.size} lenses were traced, each with all errors at once. Half of them have a "
            f"rel_l2 of at most {median.value:.2%}, and {SHOWN[2]:.0%} of at most {worst.value:.2%}.",
            f"{kept.value:.1%} of the lenses keep {limit_words(bounds)}; with {CONFIDENCE:.0%} confidence "
            f"this yield lies between {kept.low:.1%} and {kept.high:.1%}"
            + (f" ({alone})." if len(each) > 1 else "."),
            f"{good.value:.1%} of the lenses {make} the light that was asked for, by the limits of [verify]; "
            f"with {CONFIDENCE:.0%} confidence the yield lies between {good.low:.1%} and {good.high:.1%}.",
            f"Root mean square they have {sqrt(batch.mean_square().value):.2%}; rises by single errors add "
            f"up to {self.expected:.2%}.",
        ]
        if batch.undecided:
            lines.append(
                f"Of {batch.undecided:.1%} of the lenses the rays do not tell whether their light is that; "
                "raise target.pixels, which more rays go with."
            )
        lines += [
            f"The form of {the}{form.surface} is random, {1e6 * form.rms:.3g} nm rms with periods from "
            f"{form.band[0]:g} to {form.band[1]:g} mm."
            for form in self.model.forms
        ]
        return lines + [f"Not traced: {sentence}" for sentence in batch.failures]
