"""The greatest amount of an error with which light keeps its limits, by a few exact traces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import log, sqrt

import numpy as np

from optics.base.runtime import UserError

Point = tuple[float, float]  # an amount, and the part of the limits that it takes

SEARCH = 7  # traces of both signs, at most, that look for the amount that is allowed
LEAST, AIM = 0.98, 0.99  # of the limits: so much an allowed amount takes, and the next one is to take
POWER = 2.0  # of the amount, with which parts grow as long as one amount is known: that of rel_l2^2
POWERS = 0.5, 8.0  # within which they grow between two amounts
FARTHER = 10.0  # times as large as the amount before, at most, is the next guess
FREE = 100.0  # times the usual amount: an error that may be so large needs no care


def amount_of(taken: Callable[[float], float], first: Point) -> Point | None:
    """Return the greatest amount, of those tried, that takes at most all of the limits.

    None where FREE times the first amount, or the largest error that a lens can have, does so, too.

    taken : traces an amount; a UserError says that no lens is so wrong.
    """
    points, most = [first], FREE * first[0]
    for _ in range(SEARCH):
        amount = None if any(LEAST <= part <= 1 for _, part in points) else _next(points, most)
        if amount is None:
            break
        try:
            points.append((amount, taken(amount)))
        except UserError:
            most = max(amount for amount, _ in points)
            break
    broken = min((amount for amount, part in points if part > 1), default=np.inf)
    kept = max((p for p in points if p[1] <= 1 and p[0] < broken), default=(0.0, 0.0))
    return None if kept[0] >= most and kept[1] < LEAST else kept


def _next(points: Sequence[Point], most: float) -> float | None:
    """Return the amount to try next; None where the largest one keeps the limits.

    Parts are taken to grow with a power of the amount.  most : that is tried.
    """
    high = min((amount for amount, part in points if part > 1), default=None)
    below = high or np.inf
    low = max((amount for amount, part in points if part <= 1 and amount < below), default=0.0)
    guess = _by_power(points)
    if high is not None:
        low = max(low, high / FARTHER**2)
        return guess if guess is not None and low < guess < high else sqrt(low * high)
    if low >= most:
        return None
    guess = FARTHER * low if guess is None or guess <= low else guess
    return min(guess, FARTHER * low, most)


def _by_power(points: Sequence[Point]) -> float | None:
    """Return the amount that takes AIM by the two points nearest to it; None where none takes any."""
    rising = sorted((p for p in points if 0 < p[1] < np.inf), key=lambda p: abs(log(p[1] / AIM)))
    if not rising:
        return None
    (amount, part), *more = rising
    power = POWER
    if more:
        power = float(np.clip(log(more[0][1] / part) / log(more[0][0] / amount), *POWERS))
    return amount * (AIM / part) ** (1 / power)
