"""Least squares in a THB space, with thin-plate smoothing and weights against outliers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from thbcad.checks import (
    Bools,
    Floats,
    Integers,
    floats,
    read_only,
    require_number,
    require_real,
    require_type,
    shown,
)
from thbcad.fitting.normal_equations import NormalEquations, thin_plate
from thbcad.fitting.residual_statistics import AROUND, biweights, kept_share, neighbours, places
from thbcad.fitting.smoothing_choice import RULES, Progress, Smoothing, chosen_smoothing
from thbcad.hierarchy import THBSpace
from thbcad.surfaces import THBSurface
from thbcad.values import Value

MOST_REWEIGHTINGS = 20  # three to six are usual
SETTLED = 0.01  # change of a weight that no longer moves the fit
ROUNDING = 1e-12  # of the greatest value: smaller residuals are those of the arithmetic


@dataclass(frozen=True, eq=False)
class Samples(Value):
    """Values z_k at scattered points (u_k, v_k), with weights w_k >= 0 in least squares.

    u, v : (n,) float.  values : (n,) or (n, d) float.  weights : (n,) float, all 1 if left out.

    Raises ValueError : shapes that do not agree, numbers not finite or masked, negative
        weights.

    >>> x = np.linspace(0, 1, 9)
    >>> samples = Samples.grid(x, x, np.add.outer(x, x**2))
    >>> kv = KnotVector.uniform(degree=2, spans=1)
    >>> least_squares(THBSpace(kv, kv), samples)([0.5], [0.5]).round(12).tolist()
    [0.75]
    """

    u: Floats
    v: Floats
    values: Floats
    weights: Floats

    def __init__(
        self, u: ArrayLike, v: ArrayLike, values: ArrayLike, weights: ArrayLike | None = None
    ) -> None:
        n = np.shape(values)[:1]
        arrays = {"u": u, "v": v, "values": values, "weights": np.ones(n) if weights is None else weights}
        for name, given in arrays.items():
            array = read_only(given)
            if (
                array.shape[:1] != n
                or 0 in array.shape[1:]
                or not 1 <= array.ndim <= (2 if name == "values" else 1)
            ):
                shapes = ", ".join(f"{key} {np.shape(x)}" for key, x in arrays.items())
                raise ValueError(
                    f"samples need u (n,), v (n,), values (n,) or (n, d), weights (n,), got shapes {shapes}"
                )
            bad = ~np.isfinite(array)
            if bad.any():
                raise ValueError(f"{name}[{int(np.nonzero(bad)[0][0])}] is not finite")
            vars(self)[name] = array
        if (self.weights < 0).any():
            k = int(np.argmax(self.weights < 0))
            raise ValueError(f"weights must not be negative, got weights[{k}] = {self.weights[k]}")

    def __repr__(self) -> str:
        rest = self.values.shape[1:]
        return f"Samples({len(self)} points, values {f'in {rest[0]} dimensions' if rest else 'scalar'})"

    @classmethod
    def grid(cls, u: ArrayLike, v: ArrayLike, values: ArrayLike) -> Samples:
        """Return the samples of a height map: values (n_u, n_v) or (n_u, n_v, d) on the grid u x v."""
        u, v, values = (floats(x) for x in (u, v, values))
        if u.ndim != 1 or v.ndim != 1 or values.shape[:2] != (len(u), len(v)):
            raise ValueError(
                f"a height map over u {u.shape} and v {v.shape} needs values (n_u, n_v), got shape "
                f"{values.shape}"
            )
        return cls(
            np.repeat(u, len(v)), np.tile(v, len(u)), values.reshape(u.size * v.size, *values.shape[2:])
        )

    def __getitem__(self, chosen: slice | Integers | Bools) -> Samples:
        """Return some of the samples."""
        return Samples(self.u[chosen], self.v[chosen], self.values[chosen], self.weights[chosen])

    def __len__(self) -> int:
        return len(self.u)


def least_squares(
    space: THBSpace,
    samples: Samples,
    smoothing: Smoothing = 0.0,
    robust: bool = False,
    progress: Progress | None = None,
) -> THBSurface:
    """Return the spline s of the space with the least weighted sum of squares plus thin-plate energy.

    Minimises  sum_k w_k t_k |s(u_k, v_k) - z_k|^2 + smoothing * integral of (s_uu^2 + 2 s_uv^2 + s_vv^2)
    du dv, so that `smoothing` has the unit of a length squared in the parameters.

    smoothing : a number; "auto" (the least of generalised cross-validation: weights are the inverse variances
        of the samples up to a factor); "discrepancy" (as much that the sum of squares is the number of sample
        values: weights are the inverse variances themselves).
    robust : t_k are Tukey's biweights (`robust_weights`) over their mean effect on normally distributed
        noise, found by reweighting until they settle; otherwise 1.
    progress : called, while a smoothing is chosen, with the number of fits that are done, and the most there
        may be, 15.  Seven are usual; a robust fit chooses twice.

    Raises Underdetermined : the samples do not determine every coefficient (names a function).
    Raises ValueError : samples outside the domain, a smoothing that is negative or not finite.
    """
    require_type("space", space, THBSpace)
    require_type("samples", samples, Samples)
    require_type("robust", robust, bool)
    require_smoothing(smoothing)
    show = progress or (lambda done, most: None)
    energy = thin_plate(space) if smoothing != 0 else csr_array((space.dim, space.dim))
    collocation = space.collocation(samples.u, samples.v)
    equations = NormalEquations.of(space, collocation, energy, samples.values, samples.weights)
    if robust and (samples.weights > 0).any():
        return _robust(equations, samples, smoothing, show)
    return _fitted(equations, _as_number(equations, smoothing, show))


def require_smoothing(smoothing: object) -> None:
    """Raise ValueError unless it is "auto", "discrepancy", or a finite number that is not negative."""
    if isinstance(smoothing, str):
        if smoothing not in RULES:
            raise ValueError(f"smoothing must be a number or one of {RULES}, got {shown(smoothing)}")
    else:
        require_number("smoothing", smoothing, least=0, finite=True)


def robust_weights(surface: THBSurface, samples: Samples) -> Floats:
    """Return Tukey's biweights of the samples of a robust fit, (n,) from 0 to 1: 0 for outliers.

    An outlier differs from the surface by much more than its twelve nearest good samples do, and than these
    differ from each other (`tukey_weights`); and it lies beyond their own values, alone or in a small clump
    (`biweights`).  Other samples that differ show detail that the surface lacks, and keep weight.
    Samples of weight 0 are left out, and get 0.
    """
    return _Judge.of(samples).weights(samples.values - surface(samples.u, samples.v))


@dataclass(frozen=True, eq=False)
class _Judge:
    """Gives samples their weights by residuals: whatever depends on the samples alone is found once."""

    used: Bools  # those of positive weight
    roots: Floats  # of their weights over the greatest
    values: Floats  # (used, d), over the height
    height: float
    points: Floats
    near: Integers

    @classmethod
    def of(cls, samples: Samples) -> _Judge:
        used = samples.weights > 0
        u, v, weights = samples.u[used], samples.v[used], samples.weights[used]
        height = float(np.abs(samples.values).max()) or 1.0
        values = (samples.values[used] / height).reshape(len(u), -1)
        roots = np.sqrt(weights / weights.max(initial=0))
        return cls(used, roots, values, height, places(u, v), neighbours(u, v, AROUND))

    def weights(self, residuals: Floats) -> Floats:
        """Return the weights that belong to residuals (n,) or (n, d), (n,); 0 for samples not used."""
        relative = self.roots[:, None] * (residuals[self.used] / self.height).reshape(len(self.roots), -1)
        out = np.zeros(len(residuals))
        out[self.used] = biweights(relative, self.values, self.points, self.near, ROUNDING)
        return out


def _as_number(equations: NormalEquations, wanted: Smoothing, progress: Progress) -> float:
    """Return a smoothing as a number."""
    return chosen_smoothing(equations, wanted, progress) if isinstance(wanted, str) else wanted


def _fitted(equations: NormalEquations, smoothing: float) -> THBSurface:
    return THBSurface(equations.space, equations.height * equations.solution(smoothing))


def _robust(
    equations: NormalEquations, samples: Samples, wanted: Smoothing, progress: Progress
) -> THBSurface:
    """Return the fit whose weights belong to its own residuals.

    The first weights are those of the values themselves: a fit with equal weights may pass through an outlier
    that lies alone at the border.  The smoothing is chosen with them, and again when they have settled.
    """
    judge = _Judge.of(samples)
    share = kept_share(judge.values.shape[1])
    weights = judge.weights(samples.values)
    weighted = equations.with_weights(samples.weights * (weights / share))
    smoothing = _as_number(weighted, wanted, progress)
    for _ in range(MOST_REWEIGHTINGS):
        surface = _fitted(weighted, smoothing)
        values: Floats = equations.collocation @ surface.coefficients
        before, weights = weights, judge.weights(samples.values - values)
        weighted = equations.with_weights(samples.weights * (weights / share))
        if np.abs(weights - before).max() <= SETTLED:
            break
    if isinstance(wanted, str):
        surface = _fitted(weighted, _as_number(weighted, wanted, progress))
    return surface


def height_field_samples(
    heights: ArrayLike, x: ArrayLike, y: ArrayLike, missing: ArrayLike | None = None
) -> Samples:
    """Return the samples of a height field: heights[r, c] lies at u = x[c], v = y[r].

    Columns run along x and rows along y, in any direction: where row 0 is at the greatest y, as in an image,
    y falls.  The centres of rows x columns pixels over |x| <= hx, |y| <= hy are

        x[c] = -hx + (c + 1/2) 2 hx / columns,   y[r] = hy - (r + 1/2) 2 hy / rows.

    Heights that are NaN, masked (`numpy.ma`) or True in `missing` are left out.  `Samples.grid` takes arrays
    whose first index runs along u instead.

    heights : (rows, columns) float.  x : (columns,) and y : (rows,) float, strictly rising or falling.
    missing : (rows, columns) bool.

    Raises ValueError : shapes that do not agree, x or y that turn or repeat, heights that are infinite, no
        height that is left.
    """
    x, y = (_axis(name, values) for name, values in (("x", x), ("y", y)))
    masked: np.ma.MaskedArray = np.ma.asarray(heights)
    require_real(masked.data)
    gaps, field = np.ma.getmaskarray(masked), np.array(masked.data, dtype=np.float64)
    if field.shape != (len(y), len(x)):
        raise ValueError(
            f"a height field with {len(y)} rows y and {len(x)} columns x needs heights ({len(y)}, {len(x)}), "
            f"got shape {field.shape}"
        )
    if missing is not None:
        missing = np.asarray(missing)
        if missing.dtype != bool or missing.shape != field.shape:
            raise ValueError(
                f"missing must be bool of shape {field.shape}, got {missing.dtype} of shape {missing.shape}"
            )
        gaps = gaps | missing
    row, column = np.nonzero(~gaps & ~np.isnan(field))
    if not len(row):
        raise ValueError(f"none of the {field.size} heights is left: all are NaN, masked or missing")
    return Samples(x[column], y[row], field[row, column])


def _axis(name: str, values: ArrayLike) -> Floats:
    """Return the coordinates of columns or rows; refuse those that turn or repeat."""
    require_real(values)
    out = np.asarray(values, dtype=np.float64)
    steps = np.diff(out)
    if out.ndim != 1 or not np.isfinite(out).all() or not ((steps > 0).all() or (steps < 0).all()):
        raise ValueError(f"{name} must be a row of finite numbers that strictly rises or falls")
    return out
