"""Functions of two variables that users give, and interpolation of them at the Greville points.

Source: C. de Boor, A Practical Guide to Splines, chapter 13.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from thbcad.checks import Floats, floats, require_type
from thbcad.splines.bsplines import BSplineSurface
from thbcad.splines.knot_vector import KnotVector

Function = Callable[[Floats, Floats], Floats]


def evaluate(function: Function, u: Floats, v: Floats) -> Floats:
    """Return function(u, v) as float64, (n,) or (n, d), at points of shape (n,).

    Raises ValueError : what is no function; values of another shape, complex or not finite.
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


def interpolate(kv_u: KnotVector, kv_v: KnotVector, target: Function | ArrayLike) -> BSplineSurface:
    """Return the spline that takes given values at the Greville points.

    Solves A_u C A_v^T = Z with the collocation matrices at the Greville abscissae.  Other knots are
    clamped first.

    target : a function of u and v, (n,) float each, that returns (n,) or (n, d), or the values Z,
        (kv_u.dim, kv_v.dim) or (kv_u.dim, kv_v.dim, d)

    Raises ValueError : values of another shape, or not finite.
    """
    for name, kv in (("kv_u", kv_u), ("kv_v", kv_v)):
        require_type(name, kv, KnotVector)
    kv_u, kv_v = (kv if kv.is_clamped else kv.clamp()[0] for kv in (kv_u, kv_v))
    u, v = kv_u.greville(), kv_v.greville()
    if callable(target):
        flat = evaluate(target, np.repeat(u, len(v)), np.tile(v, len(u)))
        values = flat.reshape(len(u), len(v), *flat.shape[1:])
    else:
        values = floats(target)
        if values.shape[:2] != (len(u), len(v)) or values.ndim > 3 or not np.isfinite(values).all():
            wanted = f"{(len(u), len(v))} or {(len(u), len(v), 'd')}"
            raise ValueError(f"target must hold finite values of shape {wanted}, got shape {values.shape}")
    by_u = make_interp_spline(u, values, kv_u.degree, t=kv_u.knots).c
    by_v = make_interp_spline(v, np.swapaxes(by_u, 0, 1), kv_v.degree, t=kv_v.knots).c
    return BSplineSurface(kv_u, kv_v, np.swapaxes(by_v, 0, 1))
