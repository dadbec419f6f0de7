"""What the page says of the constraints of section 4.4."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from benchmarks.thesis.pages import Choice, Claim, Picture, Section, Table
from benchmarks.thesis.records import Numbers, Results

FREE = "no bound"
SQUASHED = "bounded by "
BENDING = "bending energy"
OWN = SQUASHED + "this project"
ROUNDING = 1e-12  # of the bound
GAIN = 0.5  # of the misfit without a penalty: clearly another lens
SAME = 0.05  # of a misfit: what rounding on two threads changes in unconverged runs

Rows = Mapping[str, Numbers]


def label(name: str, mu: float) -> str:
    """Return the name of the run of a penalty."""
    return f"{name}, mu {mu:.0e}"


def section(results: Results) -> Section:
    """Return the section of study 3."""
    rows = {name: found.numbers for name, found in results.items()}
    return Section(
        3,
        "Constraints",
        _text(rows),
        [*_bound_claims(rows), *_penalty_claims(rows)],
        [_table(_best_of_penalties(rows))],
        (
            Picture("study3_ranges", "Range functions and their slopes (Fig. 4.6)."),
            Picture("study3_tradeoff", "Misfit against roughness, and against the greatest |c| / b."),
            Picture("study3_losses", "Least misfit by evaluations, with and without a bound."),
            Picture("study3_irradiance", "Irradiance and misfit of every form, of penalties at the best mu."),
        ),
        _choices(),
    )


def _text(rows: Rows) -> list[str]:
    free, own = rows[FREE], rows[OWN]
    return [
        "The thesis defines bounds and penalties and shows no run. Here they work on the lens of study 2. "
        f"L-BFGS has {free['evaluations']} evaluations. The forms are in "
        "[constraints.py](../../examples/thesis/constraints.py).",
        f"Without a bound the greatest coefficient is {free['greatest']:.2f} mm. The bound b is half of "
        f"that, {own['bound']:.2f} mm, so that it binds. It bounds the thickness of the net too, from both "
        "sides.",
        "Penalties: Tikhonov ||c||^2 (4.35), smoothness ||L c||^2 with the discrete Laplacian L of the net "
        "(4.36), the barrier -log(b - c) - log(b + c) (4.37, 4.38), the entropy sum p log p of p = (c + "
        "b)/(2 b) (4.39), and this project's bending energy h^2 mean |D^2 s|^2. Each has a weight mu.",
        "The project's own range function y/(1 + |y|^8)^(1/8) is the identity inside the bound.",
        _best_text(rows),
    ]


def _best_text(rows: Rows) -> str:
    """Return what the best of all forms gains."""
    best, free = min(rows, key=lambda name: rows[name]["misfit"]), rows[FREE]
    row = rows[best]
    lesson = (
        " So a penalty can do more than restrict: it can lead the optimiser to another lens."
        if row["misfit"] < GAIN * free["misfit"]
        else ""
    )
    return (
        f"The least misfit of all forms is {row['misfit']:.3f}, by {best}; without bound and penalty it is "
        f"{free['misfit']:.3f}. The roughness is {row['roughness']:.3f} and {free['roughness']:.3f}.{lesson}"
    )


def _bound_claims(rows: Rows) -> list[Claim]:
    squashed = {name.removeprefix(SQUASHED): row for name, row in rows.items() if name.startswith(SQUASHED)}
    ratio = max(row["ratio"] for row in squashed.values())
    ends = ", ".join(f"{name} {row['misfit']:.3f} ({row['at_bound']:.0%})" for name, row in squashed.items())
    least = min(row["misfit"] for row in squashed.values())
    return [
        Claim(
            "A range function such as tanh or arctan keeps every parameter within its bounds.",
            "4.4.1, 5.1",
            f"The greatest |c|/b is {ratio:.6f} (holds up to 1). Without a bound it is "
            f"{rows[FREE]['ratio']:.1f}.",
            ratio <= 1 + ROUNDING,
        ),
        Claim(
            "All designs use the arctangent; tanh would do as well.",
            "4.4.1, (5.3)",
            f"Misfits, and coefficients at the bound: {ends} (holds where both are within {SAME:.0%} of the "
            "least).",
            max(squashed["tanh"]["misfit"], squashed["arctan"]["misfit"]) < (1 + SAME) * least,
        ),
    ]


def _penalty_claims(rows: Rows) -> list[Claim]:
    tikhonov, smooth, bending, barrier, entropy = (
        _family(rows, name) for name in ("Tikhonov", "smoothness", BENDING, "barrier", "entropy")
    )
    printed = barrier[-1]
    inside = max(row["ratio"] for row in barrier)
    return [
        Claim(
            "Tikhonov regularisation penalises solutions of large norm.",
            "(4.35)",
            f"From mu {tikhonov[0]['mu']:g} to {tikhonov[-1]['mu']:g} the rms of c goes from "
            f"{tikhonov[0]['size']:.3f} to {tikhonov[-1]['size']:.3f} mm and the misfit from "
            f"{tikhonov[0]['misfit']:.3f} to {tikhonov[-1]['misfit']:.3f} (holds where the rms falls). It "
            f"does not bound: the greatest |c|/b is {tikhonov[0]['ratio']:.2f} at the smallest mu.",
            tikhonov[-1]["size"] < tikhonov[0]["size"],
        ),
        Claim(
            "A discrete Laplacian in the penalty makes the solution smooth.",
            "(4.36)",
            f"Roughness goes from {smooth[0]['roughness']:.3f} to {smooth[-1]['roughness']:.3f} and the "
            f"misfit from {smooth[0]['misfit']:.3f} to {smooth[-1]['misfit']:.3f} (holds where roughness "
            f"falls). The bending energy goes from {bending[0]['roughness']:.3f} to "
            f"{bending[-1]['roughness']:.3f}, and from {bending[0]['misfit']:.3f} to "
            f"{bending[-1]['misfit']:.3f}.",
            smooth[-1]["roughness"] < smooth[0]["roughness"],
        ),
        Claim(
            "A logarithmic barrier keeps parameters inside: it grows to infinity at the bound.",
            "(4.37)",
            f"The greatest |c|/b is {inside:.6f} (holds below 1). The line search tried up to "
            f"{max(row['refused'] for row in barrier)} lenses outside, which had to be refused.",
            inside < 1,
        ),
        Claim(
            "The barrier is added to the loss without a weight.",
            "(4.38)",
            f"With weight {printed['mu']:g} the misfit stays at {printed['misfit']:.3f}; with "
            f"{barrier[0]['mu']:g} to {barrier[-2]['mu']:g} the least is "
            f"{min(row['misfit'] for row in barrier[:-1]):.3f} (holds where the printed form is not worse).",
            printed["misfit"] <= min(row["misfit"] for row in barrier[:-1]),
        ),
        Claim(
            "Maximum entropy enforces positive quantities.",
            "(4.39)",
            f"The least p is {min(row['least_p'] for row in entropy):.1e}, but entropy is finite at p = 0: "
            f"{sum(row['refused'] for row in entropy)} trials below it were refused. A bound from above it "
            f"has not: the greatest |c|/b is {max(row['ratio'] for row in entropy):.2f} (holds where no "
            "trial was refused).",
            sum(row["refused"] for row in entropy) == 0,
        ),
    ]


def _table(rows: Rows) -> Table:
    body = [
        (
            name,
            f"{row['misfit']:.3f}",
            f"{row['roughness']:.3f}",
            f"{row['ratio']:.3f}",
            f"{row['at_bound']:.0%}",
            f"{row['near']}",
            f"{row['rel_l2']:.3f}",
            f"{row['efficiency']:.3f}",
            f"{row['stray']:.4f}",
        )
        for name, row in rows.items()
    ]
    head = ("form", "misfit", "roughness", "greatest abs(c)/b", "at or beyond 0.99 b", "evaluations to 1.1 x")
    return Table(
        "Every form, of penalties that with the best mu of each: the misfit of the lens of least loss, its "
        "roughness and coefficients, the evaluations until 1.1 times its misfit, and figures of merit on "
        "fresh rays.",
        (*head, "rel_l2", "efficiency", "stray"),
        body,
    )


def _best_of_penalties(rows: Rows) -> Rows:
    """Return the runs without a penalty, and of each penalty that of the least misfit."""
    kept = {name: row for name, row in rows.items() if "mu" not in row}
    for name in dict.fromkeys(name.partition(", mu")[0] for name in rows if name not in kept):
        runs = [key for key in rows if key.startswith(f"{name}, mu")]
        best = min(runs, key=lambda key: rows[key]["misfit"])
        kept[best] = rows[best]
    return kept


def _choices() -> list[Choice]:
    return [
        Choice("a problem for section 4.4 (none in the thesis)", "that of study 2, half the sag it asks for"),
        Choice("weights mu", "decades, from hardly felt to dominant"),
        Choice("L of (4.36)", "the five-point Laplacian of the net, with the neighbours that exist"),
        Choice("the positive quantity of (4.39)", "p = (c + b)/(2 b)"),
    ]


def _family(rows: Rows, name: str) -> Sequence[Numbers]:
    """Return the runs of a penalty by rising mu."""
    return [row for key, row in rows.items() if key.startswith(f"{name}, mu")]
