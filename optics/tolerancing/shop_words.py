"""What the shop must hold, in plain sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from optics.tolerancing.tolerance_effects import ToleranceBudget, ToleranceEffect

LARGE = 0.1  # share in the expected rise: such a tolerance is worth being held closer
FREE = 10.0  # times its amount: a tolerance that may be so much larger needs no care
HEAD = (
    "tolerance",
    "amount +-",
    "moves the light",
    "rel_l2 at - / +",
    "predicted",
    "efficiency at - / +",
    "allowed +-",
    "share",
)


def shop_sentences(budget: ToleranceBudget) -> list[str]:
    """Return what must be held, which errors cost most, and which cost nothing."""
    start = f"{budget.rel_l2:.2%}"
    lines = [
        f"The design differs from the light asked for by rel_l2 = {start}. With every error anywhere within "
        f"its amount, lenses will have {budget.expected:.2%} (root mean square).",
    ]
    shares, effects = budget.shares(), {e.tolerance.name: e for e in budget.effects}
    large = [name for name, share in shares.items() if share >= LARGE]
    if large:
        parts = [f"{name} (+- {effects[name].tolerance.words}, {shares[name]:.0%})" for name in large]
        lines.append(f"Most of the rise comes from {_joined(parts)}: hold these closer first.")
    lines += [_held(effects[name], budget) for name in shares if effects[name].allowed is not None]
    free = [name for name in shares if effects[name].allowed is None]
    if free:
        lines.append(f"Of no error of {_joined(free)} was it found that it raises rel_l2 so much.")
    return lines


def _held(effect: ToleranceEffect, budget: ToleranceBudget) -> str:
    assert effect.allowed is not None
    amount, there = effect.allowed
    tolerance = effect.tolerance
    more = " It needs no care." if amount > FREE * tolerance.amount else ""
    return (
        f"Hold {tolerance.name} within +- {tolerance.in_words(amount)}: alone it then raises rel_l2 from "
        f"{budget.rel_l2:.2%} to {there:.2%} at most.{more}"
    )


def _joined(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def effect_rows(budget: ToleranceBudget) -> list[tuple[str, ...]]:
    """Return a row of texts for every tolerance, largest share first, under HEAD."""
    effects = {e.tolerance.name: e for e in budget.effects}
    return [_row(effects[name], share, budget.unit) for name, share in budget.shares().items()]


def _row(effect: ToleranceEffect, share: float, unit: str) -> tuple[str, ...]:
    def both(pair: tuple[float, float] | None) -> str:
        return "-" if pair is None else f"{pair[0]:.2%} / {pair[1]:.2%}"

    allowed = "-" if effect.allowed is None else effect.tolerance.in_words(effect.allowed[0])
    return (
        effect.tolerance.name,
        effect.tolerance.words,
        f"{effect.moves[0]:.3g} {unit}, {effect.moves[1]:.2g} pixels",
        both(effect.rel_l2),
        both(effect.predicted),
        both(effect.efficiency),
        allowed,
        f"{share:.1%}",
    )
