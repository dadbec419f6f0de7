"""Choice of the smoothing from the samples themselves.

Generalised cross-validation takes the least of

    V(smoothing) = n RSS / (n - tr H)^2,   RSS = sum_k w_k |s(u_k, v_k) - z_k|^2,

where the matrix H takes the samples to the values of their fit, and n counts the samples of positive
weight.  V estimates, up to a constant, the error at points that are not among the samples; the weights are
the inverse variances of the samples up to one unknown factor.  Up to 500 functions the trace is exact; for
more it is estimated with 32 vectors z of random signs, tr H = mean of z^T H z, the same for all smoothings.

Both follow from solutions x = N^-1 r with the normal matrix N of a smoothing, for right sides r of the
samples and of the signs.  They lie near the span of the solutions for a few other smoothings, in which
Galerkin's method finds them without another factorisation (a rational Krylov space).  Smoothings are added
where this V is least, until that place stays.

The discrepancy principle takes the smoothing where RSS = n d, for d components: there the weights are
the inverse variances themselves.

Source: P. Craven, G. Wahba, Smoothing noisy data with spline functions, Numer. Math. 31 (1979); D. Girard,
A fast Monte-Carlo cross-validation procedure, Numer. Math. 56 (1989); V. Morozov, On the solution of
functional equations by the method of regularization, Soviet Math. Dokl. 7 (1966); A. Ruhe, Rational Krylov
sequence methods for eigenvalue computation, Linear Algebra Appl. 58 (1984).
"""

import math
from collections.abc import Callable
from itertools import count
from typing import Literal, get_args

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from thbcad.checks import Floats
from thbcad.fitting.normal_equations import NormalEquations, Underdetermined

Rule = Literal["auto", "discrepancy"]
Smoothing = float | Rule
RULES = get_args(Rule)
Progress = Callable[[int, int], object]  # fits that are done, and the most there may be

EXACT = 500  # functions: the trace of H then costs less than a factorisation of thousands
PROBES = 32  # V of 1000 samples is then known to 2 %, and its shape better
# At the least smoothing a wave of two cells loses 0.4 % of its height, at the greatest a wave of the
# domain's length keeps 0.2 %: the energies of such waves are 400 / cell^4 and 500 / domain^4 of the squares.
LEAST = 1e-5
EXPONENT = 0.01  # of ten: V and the fit are flat around the minimum
START = 4.5  # of ten, between the exponents that are known first; three or four more are usual
STEP = 0.5  # of ten, between exponents that are compared
FAR = 1.0  # of ten: Galerkin's V is exact at its smoothings, and sure between two that are nearer
MOST_FITS = 15


def chosen_smoothing(equations: NormalEquations, rule: Rule, progress: Progress) -> float:
    """Return the smoothing that the samples ask for."""
    if not equations.weights.any():
        return 0.0
    return (_cross_validated if rule == "auto" else _discrepant)(equations, progress)


def _range(equations: NormalEquations) -> tuple[float, float]:
    """Return the powers of ten of the least and the greatest smoothing that make a difference."""
    u0, u1, v0, v1 = equations.space.boxes.T
    least = min((u1 - u0).min(), (v1 - v0).min())
    sides = u1.max() - u0.min(), v1.max() - v0.min()
    density = equations.weights.sum() * equations.unit / (sides[0] * sides[1])
    low, high = np.log10(density) + 4 * np.log10([least, max(sides)])
    return float(low + np.log10(LEAST)), float(high)


# ---- generalised cross-validation ----


def _cross_validated(equations: NormalEquations, progress: Progress) -> float:
    """Return the smoothing of least V, or no smoothing."""
    curve, (least, most) = _Curve(equations), _range(equations)
    low, high = least, most
    parts = math.ceil((high - low) / START)
    ahead: list[float | None] = [low + (k + 0.5) / parts * (high - low) for k in range(parts)]
    for done in range(1, MOST_FITS + 1):
        exponent = ahead.pop(0) if ahead else curve.next(low, high)
        if exponent is None:
            break
        if not curve.add(exponent):
            if any(known < exponent for known in curve.exponents):
                high = min(high, exponent - STEP)
            else:
                low = max(low, exponent + STEP)
        progress(done, MOST_FITS)
    if not curve.exponents:
        return float(10**most)
    score, exponent = min(zip(curve.scores, curve.exponents))
    if exponent < least + EXPONENT and curve.solved(0.0)[1] < score:
        return 0.0
    return float(10**exponent)


class _Curve:
    """V by the exponent of the smoothing: exact at some, by Galerkin's method in between."""

    def __init__(self, equations: NormalEquations) -> None:
        self.equations = equations
        self.values = equations.values.reshape(len(equations.values), -1)
        self.left, right = _probes(equations)
        self.right = np.column_stack([right, equations.weighted @ self.values])
        self.signs = right.shape[1]
        self.exponents: list[float] = []
        self.scores: list[float] = []
        self.basis: list[Floats] = []  # (dim, right sides) each, orthonormal for each right side
        self.images: list[Floats] = []  # A times those of the samples
        self.gram = self.energy = np.zeros((self.right.shape[1], 0, 0))  # A^T W A and E in the basis
        self.lefts, self.rights = np.zeros((self.signs, 0)), np.zeros((self.right.shape[1], 0))

    def solved(self, smoothing: float) -> tuple[Floats, float]:
        """Return N^-1 of all right sides, and V: inf where the samples do not determine the fit or leave
        nothing to validate."""
        equations = self.equations
        try:
            factors = equations.factors(smoothing)
        except Underdetermined:
            return self.right, float("inf")
        c = equations.solution(smoothing, factors)
        signs = factors.solve(self.right[:, : self.signs])
        score = self.score(float(np.sum(self.left * signs)), equations.misfit(c))
        return np.column_stack([signs, c.reshape(len(c), -1)]), score

    def score(self, trace: float, misfit: float) -> float:
        n = int(np.count_nonzero(self.equations.weights))
        return n * misfit / (n - trace) ** 2 if n - trace >= 0.5 else float("inf")

    def add(self, exponent: float) -> bool:
        """Take a smoothing into the basis; return whether its V is finite, and leave it out otherwise."""
        x, score = self.solved(10.0**exponent)
        if score == float("inf"):
            return False
        for _ in range(2):  # Gram-Schmidt, twice for rounding
            for q in self.basis:
                x -= q * np.sum(q * x, axis=0)
            size = np.linalg.norm(x, axis=0)
            x /= np.where(size, size, 1.0)
        self.exponents.append(exponent)
        self.scores.append(score)
        self.basis.append(x)
        self.lefts = np.column_stack([self.lefts, np.sum(x[:, : self.signs] * self.left, axis=0)])
        self.rights = np.column_stack([self.rights, np.sum(x * self.right, axis=0)])
        self.images.append(self.equations.collocation @ x[:, self.signs :])
        self.gram = self._bordered(self.gram, self.equations.gram @ x)
        self.gram[:, -1, -1] += size == 0
        self.energy = self._bordered(self.energy, self.equations.energy @ x / self.equations.unit)
        return True

    def _bordered(self, matrices: Floats, x: Floats) -> Floats:
        """Return the matrices with a row and a column more: the products of x with the basis."""
        wider = np.pad(matrices, ((0, 0), (0, 1), (0, 1)))
        wider[:, -1, :] = wider[:, :, -1] = np.transpose([np.sum(q * x, axis=0) for q in self.basis])
        return wider

    def value(self, exponent: float) -> float:
        """Return V by Galerkin's method."""
        y = np.linalg.solve(self.gram + 10.0**exponent * self.energy, self.rights[:, :, None])[:, :, 0]
        fitted = sum(image * weight for image, weight in zip(self.images, y[self.signs :].T))
        misfit = float(self.equations.weights @ ((self.values - fitted) ** 2).sum(axis=1))
        return self.score(float(np.sum(self.lefts * y[: self.signs])), misfit)

    def next(self, low: float, high: float) -> float | None:
        """Return the exponent where V is least, one beside it where it is known there alone, or None where it
        is known around it."""
        if not self.exponents or low > high:
            return None
        exponents = np.linspace(low, high, max(int((high - low) / STEP), 1) + 1)
        values = [self.value(e) for e in exponents]
        k = len(values) - 1 - int(np.argmin(values[::-1]))
        around = exponents[max(k - 1, 0)], exponents[min(k + 1, len(exponents) - 1)]
        found = minimize_scalar(self.value, bounds=around, method="bounded", options={"xatol": EXPONENT / 2})
        exponent = float(found.x if found.fun < values[k] else exponents[k])
        apart = np.array(self.exponents) - exponent
        if np.abs(apart).min() > EXPONENT:
            return exponent
        for beside in (exponent - STEP, exponent + STEP):
            side = apart * np.sign(beside - exponent)
            if low < beside < high and not ((side > EXPONENT) & (side < FAR)).any():
                return float(beside)
        return None


def _probes(equations: NormalEquations) -> tuple[Floats, Floats]:
    """Return (L, R), (dim, m) each, with tr H = sum of L * (N^-1 R)."""
    if equations.space.dim <= EXACT:
        return equations.gram.toarray(), np.eye(equations.space.dim)
    rng, roots = np.random.default_rng(0), np.sqrt(equations.weights)
    signs = (rng.choice([-1.0, 1.0], len(roots)) for _ in range(PROBES))
    seen = np.column_stack([equations.collocation.T @ (roots * z) for z in signs])
    return seen / PROBES, seen


# ---- the discrepancy principle ----


def _discrepant(equations: NormalEquations, progress: Progress) -> float:
    """Return the smoothing whose RSS is n d; the RSS grows with the smoothing."""
    n = int(np.count_nonzero(equations.weights)) * equations.values[0].size
    target = n / equations.unit / equations.height / equations.height
    done = count(1)

    def excess(exponent: float) -> float:
        progress(min(next(done), MOST_FITS), MOST_FITS)
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
