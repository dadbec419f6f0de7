"""How far the THB kernel is from exact rational arithmetic, and where it refuses input.

Run: thbcad bench stability

`oracles.kernel_accuracy` says what the errors are relative to, and where their limits come from.
"""

from __future__ import annotations

import numpy as np

from benchmarks.rows.row import Row
from oracles.exact_splines import roundings
from oracles.kernel_accuracy import REFUSED, Errors, coarsened, deepest, measure, window
from oracles.spline_definitions import gamma
from oracles.stresses import STRESSES, Case, clamped, random_breaks
from thbcad import KnotVector, THBSpace, THBSurface

SEQUENCES = 2000
STEPS = 2


def rows() -> list[Row]:
    """Return the measured rows."""
    rng = np.random.default_rng(20)
    out = []
    for name, cases, per in STRESSES:
        measured = [(case, measure(case.space, rng)) for case in cases(rng)]
        out += _worst(name, measured)
        if per:
            out += _growth(name, per, measured)
    return [*out, *_walks(rng), *_refusals()]


def _worst(name: str, measured: list[tuple[Case, Errors]]) -> list[Row]:
    """Return for each quantity the greatest error, of the cases above their limit if there are any."""
    out = []
    for quantity in dict.fromkeys(quantity for _, errors in measured for quantity in errors):
        held = [(errors[quantity], case.label) for case, errors in measured if quantity in errors]
        if quantity == REFUSED:
            out.append(
                Row(f"{name}: {quantity}", len(held), "", f"of {len(measured)}, the first {held[0][1]}")
            )
            continue
        (error, limit), label = max(held, key=lambda pair: (pair[0][0] > pair[0][1], pair[0][0]))
        out.append(Row(f"{name}: {quantity}", error, "", label, None if limit == np.inf else limit))
    return out


def _growth(name: str, per: str, measured: list[tuple[Case, Errors]]) -> list[Row]:
    """Return the factors exp(b) of the fits log(error) = a + b x; errors below half a unit roundoff count as
    that."""
    out = []
    for quantity in ("values of the surface", "derivatives, to the leaf cell's", "row sums of |Q|"):
        x, y = np.array(
            [(case.x, max(errors[quantity][0], 2.0**-54)) for case, errors in measured if quantity in errors]
        ).T
        slope, _ = np.polyfit(x, np.log(y), 1)
        out.append(
            Row(f"{name}: growth of {quantity}", float(np.exp(slope)), f"/{per}", f"fitted to {len(x)} cases")
        )
    return out


def _walks(rng: np.random.Generator) -> list[Row]:
    """Return the worst errors of random sequences of refinement and coarsening, as multiples of their
    limits."""
    errors = []
    for _ in range(SEQUENCES):
        p, q = rng.integers(1, 5, 2)
        space = THBSpace(clamped(p, random_breaks(rng, p + 2)), clamped(q, random_breaks(rng, q + 2)))
        surface = THBSurface(space, rng.uniform(-1, 1, space.dim))
        for _ in range(STEPS):
            surface, found = _step(surface, rng)
            errors.append(found)
    unity, negative, moved, back = np.max(errors, axis=0).tolist()
    name = f"{SEQUENCES} random walks"
    return [
        Row(f"{name}: sum of functions - 1, of its limit", unity, "", f"{STEPS} steps each", 1),
        Row(f"{name}: negative part of functions", negative, "", "", 0),
        Row(f"{name}: refine moves the surface, of its limit", moved, "", "", 1),
        Row(f"{name}: refine then coarsen, of its limit", back, "", "", 1),
    ]


def _step(
    surface: THBSurface, rng: np.random.Generator
) -> tuple[THBSurface, tuple[float, float, float, float]]:
    """Return a surface over a coarsened or refined space, and four errors of the refinement tried."""
    space, size = surface.space, float(abs(surface.coefficients).max())
    cells = window(space, rng)
    finer = surface.refine(cells)
    u, v = (kv.start + (kv.stop - kv.start) * rng.random(20) for kv in (space.kv_u, space.kv_v))
    weights, limit = finer.space.collocation(u, v), float(gamma(3 * roundings(finer.space)))
    q = finer.space.restriction(finer.space.coarsen(cells))
    back = abs(q @ finer.coefficients - surface.coefficients).max() / abs(q).sum(axis=1).max()
    errors = (
        float(abs(weights.sum(axis=1) - 1).max()) / limit,
        float(max(0.0, -weights.data.min())),
        float(abs(finer(u, v) - surface(u, v)).max()) / (size * limit),
        float(back) / (size * limit),
    )
    level = int(rng.integers(0, finer.space.levels - 1))
    return finer if rng.random() < 0.6 else coarsened(finer, level, rng), errors


def _refusals() -> list[Row]:
    """Return the deepest levels; a knot span s at an offset x reaches the level with s / 2^level >= spacing
    of floats at x."""
    out = []
    for name, kv, wanted in (
        (
            "offset 1e6, one span of 1e-3",
            KnotVector.uniform(3, 1, 1e6, 1e6 + 1e-3),
            np.log2(1e-3 / np.spacing(1e6)),
        ),
        (
            "offset 1e6, 8 spans on 1e-6",
            KnotVector.uniform(3, 8, 1e6, 1e6 + 1e-6),
            np.log2(1e-6 / 8 / np.spacing(1e6)),
        ),
        ("8 spans on [0, 1]", KnotVector.uniform(3, 8), 24),
        ("256 spans on [0, 1]", KnotVector.uniform(3, 256), 23),
    ):
        level, sentence = deepest(kv, min(kv.spans, 4))
        out.append(Row(f"deepest level, {name}", level, "", f"then: {sentence}", int(wanted), ">="))
    return out
