"""The first screen of `thbcad tolerance`: the costliest tolerances, and what the shop must hold."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from optics.interface.screens.screen import Entry, Screen, rows_of, typeset
from optics.tolerancing.form_errors import FormErrors, height_text
from optics.tolerancing.perturbations import ToleranceBudget, effect_rows, limit_words

COSTLIEST = 5
HEAD = ("costliest", "± amount", "± allowed", "used", "limit reached")  # the first columns of `effect_rows`


def tolerance_screen(
    budget: ToleranceBudget, form: FormErrors | None, notes: Sequence[str], title: str, page: Path
) -> Screen:
    """Return the screen of a tolerance budget, the costliest tolerances first.

    form : None where form errors were not computed.  notes : sentences.  page : that has all tables.
    """
    cells = (map(typeset, row[: len(HEAD)]) for row in effect_rows(budget)[:COSTLIEST])
    table = rows_of([HEAD, *map(tuple, cells)])
    rows = [Entry("limits", limit_words(budget.bounds))] if budget.bounds else []
    rows += [Entry("", row) for row in table]
    rows.append(
        Entry(
            "together", f"error {budget.expected:.2%} rms with all of them, {budget.rel_l2:.2%} as designed"
        )
    )
    for side in form.sides if form is not None else ():
        low, high = side.danger.band
        hold = height_text(side.danger.allowed_rms)
        rows.append(Entry("form", f"{side.side}: hold {hold} rms at periods of {low:g} to {high:g} mm"))
    rows += [Entry("note", note) for note in notes]
    return Screen(title, _state(budget), (*rows, Entry("files", str(page), "more: --full")))


def _state(budget: ToleranceBudget) -> str:
    count, loose = len(budget.effects), sum(effect.cost > 1 for effect in budget.effects)
    if budget.missed:
        return "the design itself misses its limits"
    return (
        f"{loose} of {count} tolerances are too loose" if loose else f"all {count} tolerances keep the limits"
    )
