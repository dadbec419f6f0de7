"""What shop and mount must hold, in plain sentences: the costliest errors first, and a table of all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from optics.tolerancing.perturbations.light_limits import RISE, LightNumbers
from optics.tolerancing.perturbations.tolerance_effects import ToleranceBudget, ToleranceEffect
from optics.tolerancing.perturbations.tolerance_trials import FREE

EASY = 0.25  # of an allowed amount: a usual one that is no more needs no care
SAID = 5  # tolerances of each holder that have a sentence; the others are in the table
HOLDERS = {"shop": "The shop", "mount": "Who mounts part, source and target"}  # by Tolerance.held_by
MANY = 100  # times an amount: from here on it costs nothing
NOISY = 0.01  # of a pixel's mean: from such noise on the least of all pixels is not that of the light
HEAD = (
    "tolerance",
    "amount +-",
    "allowed +-",
    "amount / allowed",
    "limit reached",
    "moves the light",
    "rel_l2 at - / +",
    "predicted",
    "min_over_mean at - / +",
    "efficiency at - / +",
    "share",
)
SIGNS = {"rel_l2": "at most", "min_over_mean": "at least", "efficiency": "at least"}


def shop_sentences(budget: ToleranceBudget) -> list[str]:
    """Return what light must keep, which errors cost most, which cost nothing, and what to expect."""
    ranked = budget.by_cost()
    free = [e.tolerance.name for e in ranked if e.allowed is None]
    keep = limit_words(budget.bounds)
    floats = "; the light may shift as a whole on the target, which follows it" if budget.floats else ""
    lines = [f"The design has {_numbers(budget.light)}. Each error alone must keep {keep}{floats}."]
    if budget.missed:
        parts = [
            f"{name} {_number(name, budget.light.data()[name])}, the limit is {_number(name, bound)}"
            for name, bound in budget.missed.items()
        ]
        lines.append(
            f"The design itself misses what its errors are to keep ({'; '.join(parts)}), so that no error is "
            f"allowed: improve it, or give a limit that it keeps, such as --limit {RISE:g}, a rise of rel_l2."
        )
    else:
        for held_by, holder in HOLDERS.items():
            limited = [e for e in ranked if e.allowed is not None and e.tolerance.held_by == held_by]
            lines += _of_holder(holder, limited)
        if free:
            lines.append(
                f"No care needed: {', '.join(free)}. No error of these was found that reaches a limit, up to "
                f"{FREE:g} times the amount or to the largest that a lens can have."
            )
    lines.append(
        f"With every error anywhere within its amount, lenses will have rel_l2 = {budget.expected:.2%} "
        "(root mean square)." + _together(budget)
    )
    if budget.outages:
        number, worst = max(enumerate(budget.outages, 1), key=lambda row: row[1].rel_l2)
        lines.append(
            f"With one of {len(budget.outages)} sources out the light has, at worst, {_numbers(worst)} "
            f"(source {number})."
        )
    if "min_over_mean" in budget.bounds and budget.noise >= NOISY:  # it is that of counted rays
        lines.append(
            f"Rays are counted here: the noise of a lit pixel is {budget.noise:.0%} and makes "
            "min_over_mean uncertain; limit rel_l2 or efficiency, or measure on more pixels "
            "(target.pixels), which takes more rays."
        )
    return lines


def limit_words(bounds: Mapping[str, float]) -> str:
    """Return limits as words, such as "min_over_mean at least 0.700"."""
    return " and ".join(f"{n} {SIGNS[n]} {_number(n, value)}" for n, value in bounds.items())


def _of_holder(holder: str, limited: Sequence[ToleranceEffect]) -> list[str]:
    """Return what a shop or a mount must hold; where the usual amounts are far within it, that they will do.

    limited : the effects with an allowed amount, the costliest first.
    """
    costly = [effect for effect in limited if effect.cost > EASY]
    lines = [f"{holder} must hold, the costliest first:"] if costly else []
    lines += [f"{k}. {_held(effect)}" for k, effect in enumerate(costly[:SAID], 1)]
    if (more := len(costly) - SAID) > 0:
        lines.append(f"The other {more}, with lower cost, are in the table.")
    if easy := limited[len(costly) :]:
        allowed, tolerance = easy[0].allowed, easy[0].tolerance
        assert allowed is not None
        amounts, each = "the usual amounts", "each"
        if costly and len(easy) == 1:
            amounts, each = "the usual amount of the other one", "it"
        elif costly:
            amounts = f"the usual amounts of the other {len(easy)}"
        lines.append(
            f"{holder}: {amounts} will do, since {each} alone is at most {easy[0].cost:.0%} of "
            f"what keeps the limits. The nearest is {tolerance.name}: +- {tolerance.words} of +- "
            f"{tolerance.in_words(allowed.amount)}."
        )
    return lines


def _together(budget: ToleranceBudget) -> str:
    """Return what keeps the limits where everything is wrong at once."""
    if budget.missed:
        return ""
    if budget.together is None:
        return " What lenses do with all errors at once is counted by --samples."
    factor = float(f"{budget.together:.2g}")  # as it is told
    times = f"{factor:g}" if factor < MANY else f"{MANY} or more"
    if factor < 1:
        verdict = "hold all amounts together closer"
    elif any(effect.cost > 1 for effect in budget.effects):
        verdict = "hold first what costs more than 100%"
    else:
        verdict = "these amounts together keep it so"
    return (
        f" That is {_number('rel_l2', budget.bounds['rel_l2'])} where every amount is multiplied by "
        f"{times}: {verdict}."
    )


def _held(effect: ToleranceEffect) -> str:
    assert effect.allowed is not None
    allowed, tolerance = effect.allowed, effect.tolerance
    reached = f"{allowed.limit} is {_number(allowed.limit, allowed.light.data()[allowed.limit])} there"
    cost = f"its amount, +- {tolerance.words}, is {effect.cost:.0%} of that"
    return f"Hold {tolerance.name} within +- {tolerance.in_words(allowed.amount)} ({reached}); {cost}."


def _numbers(light: LightNumbers) -> str:
    return ", ".join(f"{name} {_number(name, value)}" for name, value in light.data().items())


def _number(name: str, value: float) -> str:
    return f"{value:.3f}" if name == "min_over_mean" else f"{value:.2%}"


def effect_rows(budget: ToleranceBudget) -> list[tuple[str, ...]]:
    """Return a row of texts for every tolerance, the costliest first, under HEAD."""
    shares = budget.shares()
    return [_row(e, shares[e.tolerance.name], budget.unit) for e in budget.by_cost()]


def _row(effect: ToleranceEffect, share: float, unit: str) -> tuple[str, ...]:
    def both(name: str, ends: tuple[LightNumbers, ...]) -> str:
        values = [end.data().get(name) for end in ends]
        return " / ".join("-" if v is None else _number(name, v) for v in values)

    allowed, predicted = effect.allowed, effect.predicted
    return (
        effect.tolerance.name,
        effect.tolerance.words,
        "-" if allowed is None else effect.tolerance.in_words(allowed.amount),
        "-" if allowed is None else f"{effect.cost:.0%}",
        "-" if allowed is None else allowed.limit,
        f"{effect.moves[0]:.3g} {unit}, {effect.moves[1]:.2g} pixels",
        both("rel_l2", effect.ends),
        "-" if predicted is None else " / ".join(f"{v:.2%}" for v in predicted),
        both("min_over_mean", effect.ends),
        both("efficiency", effect.ends),
        f"{share:.1%}",
    )
