"""The amount of an error whose rise of rel_l2^2 is a given one, by a few exact traces."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import sqrt

import numpy as np

from optics.runtime import UserError

Point = tuple[float, float]  # an amount, and the rise of rel_l2^2 that was traced there

SEARCH = 4  # traces of both signs, at most, that look for the amount that is allowed
ENOUGH = 0.02  # of the rise: so well is the amount known then
REACHED = 0.5  # of the rise: an amount that brings less is not the one that was looked for
MOST = 10.0  # times as large as the amount before, at most, is the next guess


def amount_of(rise: Callable[[float], float], wanted: float, first: Point) -> Point | None:
    """Return the amount, of those tried, with the rise nearest to the wanted one; None where none reaches it.

    Amounts are interpolated between (0, 0) and what was traced, as if rises had a power of the amount.

    rise : traces an amount; a UserError says that no lens is so wrong.
    """
    points = [first]
    for _ in range(SEARCH):
        amount = _next(points, wanted)
        if amount is None:
            return None
        try:
            points.append((amount, rise(amount)))
        except UserError:
            break
        if abs(points[-1][1] - wanted) < ENOUGH * wanted:
            break
    best = min(points, key=lambda p: abs(p[1] - wanted))
    return best if best[1] > REACHED * wanted else None


def _next(points: Iterable[Point], wanted: float) -> float | None:
    """Return the amount to try next; None where no amount raises rel_l2 so far."""
    rising = sorted(p for p in points if p[1] > 0)
    if not rising:
        return None
    below = [p for p in rising if p[1] <= wanted]
    above = [p for p in rising if p[1] > wanted]
    if below and above:
        (a, ra), (b, rb) = below[-1], above[0]
        if rb > ra:
            return float(a * (b / a) ** (np.log(wanted / ra) / np.log(rb / ra)))
    amount, rise = (below or above)[-1 if below else 0]
    return float(amount * np.clip(sqrt(wanted / rise), 1 / MOST, MOST))
