"""Choice of the smoothing from the samples themselves.

Generalised cross-validation takes the least of

    V(smoothing) = n RSS / (n - tr H)^2,   RSS = sum_k w_k |s(u_k, v_k) - z_k|^2,

where the matrix H takes the samples to the values of their fit, and n counts the samples of positive
weight.  V estimates, up to a constant, the error at points that are not among the samples; the weights are
the inverse variances of the samples up to one unknown factor.  Up to 500 functions the trace is exact; for
more it is estimated with 32 vectors z of random signs, tr H = mean of z^T H z, the same for all smoothings.

The discrepancy principle takes the smoothing where RSS = n d, for d components: there the weights are
the inverse variances themselves.

Source: P. Craven, G. Wahba, Smoothing noisy data with spline functions, Numer. Math. 31 (1979); D. Girard,
A fast Monte-Carlo cross-validation procedure, Numer. Math. 56 (1989); V. Morozov, On the solution of
functional equations by the method of regularization, Soviet Math. Dokl. 7 (1966).
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from thbcad.checks import Floats
from thbcad.fitting.normal_equations import NormalEquations, Underdetermined

Rule = Literal["auto", "discrepancy"]
Smoothing = float | Rule
RULES = get_args(Rule)

EXACT = 500  # functions: the trace of H then costs less than a factorisation of thousands
PROBES = 32  # V of 1000 samples is then known to 2 %, and its shape better
# At the least smoothing a wave of two cells loses 0.4 % of its height, at the greatest a wave of the
# domain's length keeps 0.2 %: the energies of such waves are 400 / cell^4 and 500 / domain^4 of the squares.
LEAST = 1e-5
EXPONENT = 0.01  # of ten: V and the fit are flat around the minimum


def chosen_smoothing(equations: NormalEquations, rule: Rule) -> float:
    """Return the smoothing that the samples ask for.

    Raises
    ------
    Underdetermined : the samples do not determine every coefficient with any smoothing.
    """
    if not equations.weights.any():
        return 0.0
    return _cross_validated(equations) if rule == "auto" else _discrepant(equations)


def _range(equations: NormalEquations) -> tuple[float, float]:
    """Return the powers of ten of the least and the greatest smoothing that make a difference."""
    u0, u1, v0, v1 = equations.space.boxes.T
    least = min((u1 - u0).min(), (v1 - v0).min())
    sides = u1.max() - u0.min(), v1.max() - v0.min()
    density = equations.weights.sum() * equations.unit / (sides[0] * sides[1])
    low, high = np.log10(density) + 4 * np.log10([least, max(sides)])
    return float(low + np.log10(LEAST)), float(high)


# ---- generalised cross-validation ----


def _cross_validated(equations: NormalEquations) -> float:
    """Return the smoothing of least V: the best power of ten, then a search around it; or no smoothing."""
    probes = _probes(equations)
    low, high = _range(equations)
    exponents = np.append(np.arange(low, high), high)
    values = [_score(equations, probes, 10.0**e) for e in exponents]
    k = len(values) - 1 - int(np.argmin(values[::-1]))
    around = exponents[max(k - 1, 0)], exponents[min(k + 1, len(exponents) - 1)]
    found = minimize_scalar(
        lambda e: _score(equations, probes, 10.0**e),
        bounds=around,
        method="bounded",
        options={"xatol": EXPONENT},
    )
    smoothing = float(10 ** (found.x if found.fun < values[k] else exponents[k]))
    if _score(equations, probes, 0.0) < min(found.fun, values[k]):
        smoothing = 0.0
    return smoothing


def _score(equations: NormalEquations, probes: tuple[Floats, Floats], smoothing: float) -> float:
    """Return V, inf where the samples do not determine the fit or leave nothing to validate."""
    try:
        factors = equations.factors(smoothing)
    except Underdetermined:
        return float("inf")
    left, right = probes
    n = int(np.count_nonzero(equations.weights))
    freedom = n - float(np.sum(left * factors.solve(right)))
    if freedom < 0.5:
        return float("inf")
    return n * equations.misfit(equations.solution(smoothing, factors)) / freedom**2


def _probes(equations: NormalEquations) -> tuple[Floats, Floats]:
    """Return (L, R), (dim, m) each, with tr H = sum of L * (N^-1 R)."""
    if equations.space.dim <= EXACT:
        return equations.gram.toarray(), np.eye(equations.space.dim)
    rng, roots = np.random.default_rng(0), np.sqrt(equations.weights)
    signs = (rng.choice([-1.0, 1.0], len(roots)) for _ in range(PROBES))
    seen = np.column_stack([equations.collocation.T @ (roots * z) for z in signs])
    return seen / PROBES, seen


# ---- the discrepancy principle ----


def _discrepant(equations: NormalEquations) -> float:
    """Return the smoothing whose RSS is n d; the RSS grows with the smoothing."""
    n = int(np.count_nonzero(equations.weights)) * equations.values[0].size
    target = n / equations.unit / equations.height / equations.height

    def excess(exponent: float) -> float:
        try:
            coefficients = equations.solution(10.0**exponent)
        except Underdetermined:
            return -1.0  # too little smoothing
        return float(equations.misfit(coefficients) / target) - 1

    low, high = _range(equations)
    if excess(low) >= 0:
        return 0.0
    if excess(high) <= 0:
        return float(10**high)
    return float(10 ** brentq(excess, low, high, xtol=EXPONENT))
