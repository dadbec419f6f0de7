"""Functions of two variables that users give, called with checks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from thbcad.checks import Floats, floats

Function = Callable[[Floats, Floats], Floats]


def evaluate(function: Function, u: Floats, v: Floats) -> Floats:
    """Return function(u, v) as float64, (n,) or (n, d), at points of shape (n,).

    Raises
    ------
    ValueError : what is no function; values of another shape, complex or not finite.
    """
    if not callable(function):
        raise ValueError(f"a function of u and v is needed, got {type(function).__name__}")
    values = floats(function(u, v))
    if values.shape[:1] != u.shape or values.ndim > 2:
        raise ValueError(
            f"the function must return ({len(u)},) or ({len(u)}, d) values for {len(u)} points, got shape "
            f"{values.shape}"
        )
    finite = np.isfinite(values.reshape(len(u), -1)).all(axis=1)
    if not finite.all():
        k = int(np.argmin(finite))
        raise ValueError(f"the function is not finite at u = {u[k]}, v = {v[k]}")
    return values
