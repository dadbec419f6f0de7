"""What the page says of the five methods of section 4.3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from benchmarks.thesis.chapter4.thin_lens import D_O, METHODS, STEPS, TABLE, F
from benchmarks.thesis.pages import Choice, Claim, Picture, Section, Table
from benchmarks.thesis.records import Numbers, Results

ROUNDING = 1e-14  # relative: tens of units in the last place
POOR = 100.0  # times the least error: a step that is clearly wrong
LITTLE = 1.2  # times the loss alone: a gradient with little overhead
NEAR = 0.25  # of the number of evaluations: within it times agree with it

Rows = Sequence[Numbers]


def section(results: Results) -> Section:
    """Return the section of study 1."""
    thin = results["thin lens"].numbers
    lenses = [found.numbers for name, found in results.items() if name.startswith("lens")]
    noisy = [found.numbers for name, found in results.items() if name.startswith("ptracer")]
    return Section(
        1,
        "Gradients by five methods",
        _text(lenses),
        [*_thin_claims(thin), *_lens_claims(lenses)],
        [
            _cost_table(lenses),
            _noise(noisy),
        ],
        (
            Picture(
                "study1_differences", "Error of dL/df by the step, as in Fig. 4.2. Exact zeros are left out."
            ),
            Picture("study1_cost", "Time of the loss with its gradient, in times of the loss alone."),
        ),
        _choices(),
    )


def _text(lenses: Rows) -> list[str]:
    sizes = ", ".join(f"{row['coefficients']}" for row in lenses)
    return [
        "The thin lens of section 4.3 has the loss L(f, d_o) = (d_o f/(d_o - f) - d_i)^2. Its gradient is "
        "computed symbolically, by forward and central differences, by forward mode, and by reverse mode. "
        "The two modes run by hand on the graph of Fig. 4.3 and by Dr.Jit.",
        f"The operating point is f = {F:g}, d_i = 2. The script is "
        "[gradients.py](../../examples/thesis/gradients.py); "
        "[computational_graph.py](../../examples/thesis/computational_graph.py) prints Tables 4.1 to 4.3, "
        "mended.",
        f"The control runs on a freeform lens, [pearl.toml](../../examples/pearl.toml), with {sizes} "
        "coefficients. The loss is the misfit of the irradiance. Reverse mode is timed for all "
        f"coefficients. Forward mode and central differences are timed for {lenses[0]['directions']} of "
        "them and extrapolated.",
    ]


def _thin_claims(thin: Numbers) -> list[Claim]:
    exact = ("forward mode", "reverse mode", "forward mode by hand", "reverse mode by hand")
    apart = max(_error(rows[name], rows["symbolic"]) for rows in thin["gradients"] for name in exact)
    rows = {method: thin[method] for method in METHODS}
    every = [row for method in METHODS for row in thin[method]]
    lost = min(
        row[key] / row["best_error"] for row in every for key in ("error_at_smallest", "error_at_greatest")
    )
    gain = min(f["best_error"] / c["best_error"] for f, c in zip(rows["forward"], rows["central"]))
    by_f, by_d_o = thin["gradients"][D_O.index(TABLE)]["symbolic"]
    tangent, adjoint_f, adjoint_d_o = thin["printed"]
    printed = max(abs(tangent / by_f - 1), abs(adjoint_f / by_f - 1), abs(adjoint_d_o / by_d_o - 1))
    return [
        Claim(
            "The chain rule on the graph gives the gradient, by a forward and by a reverse sweep.",
            "4.3.3, 4.3.4",
            f"All four agree with the symbolic gradient within {apart:.0e} (holds below {ROUNDING:.0e}).",
            apart < ROUNDING,
        ),
        Claim(
            "Tables 4.2 and 4.3 list the tangents and adjoints of all nodes.",
            "Tables 4.2, 4.3",
            f"As printed, Table 4.2 gives dL/df = {tangent:.3f}, Table 4.3 dL/df = {adjoint_f:.3f} and "
            f"dL/dd_o = {adjoint_d_o:.3f} at d_o = {TABLE:g}; right are {by_f:.3f} and {by_d_o:.3f}. Four "
            "entries are misprinted.",
            printed < ROUNDING,
        ),
        Claim(
            "Differences fail by rounding where the step is too small, by truncation where it is too large.",
            "4.3.2, Fig. 4.2",
            f"At steps of {STEPS[0]:.0e} and {STEPS[-1]:.1f} the errors are at least {lost:.0e} times those "
            f"at the best step (holds above {POOR:g}).",
            lost > POOR,
        ),
        Claim(
            "Central differences are more accurate than forward ones.",
            "4.3.2, Fig. 4.2",
            f"At the best step the error is smaller by a factor of {gain:.0f} or more, at every d_o. The "
            f"errors go with the step to the power {_span(rows['forward'], 'slope', '.2f')} forward, "
            f"{_span(rows['central'], 'slope', '.2f')} central.",
            gain > 1,
        ),
    ]


def _lens_claims(lenses: Rows) -> list[Claim]:
    last = lenses[-1]
    per_entry = [row["central"] / row["loss"] / row["coefficients"] for row in lenses]
    reverse = [row["reverse_mode"] / row["loss"] for row in lenses]
    saved = [row["forward_mode"] / row["reverse_mode"] for row in lenses]
    few = lenses[0]
    by_columns, by_rows = few["forward_mode"], few["reverse_mode"] * few["pixels"]
    return [
        Claim(
            "Central differences need 2 n evaluations; they become expensive as parameters grow.",
            "1.3, 4.3.2",
            f"They take {min(per_entry):.2f} to {max(per_entry):.2f} times the loss per coefficient (holds "
            f"within {NEAR:.0%} of 2): {last['central']:.0f} s for {last['coefficients']} coefficients, "
            "extrapolated.",
            all(abs(value / 2 - 1) < NEAR for value in per_entry),
        ),
        Claim(
            "Reverse mode is more efficient where parameters outnumber objectives.",
            "4.3.4",
            f"It is {saved[0]:.0f} to {saved[-1]:.0f} times faster than forward mode, for "
            f"{few['coefficients']} to {last['coefficients']} coefficients (holds above 1).",
            min(saved) > 1,
        ),
        Claim(
            "Forward mode is most efficient where objectives outnumber parameters.",
            "4.3.3",
            f"The derivatives of {few['pixels']} pixels by {few['coefficients']} coefficients take "
            f"{by_columns:.0f} s forward and {by_rows:.0f} s in reverse, both extrapolated (holds where "
            "forward is faster).",
            by_columns < by_rows,
        ),
        Claim(
            "Algorithmic differentiation adds little to no overhead to the simulation.",
            "1.3",
            f"The loss with its gradient takes {reverse[0]:.1f} times the loss alone for "
            f"{few['coefficients']} coefficients, {reverse[-1]:.1f} times for {last['coefficients']} (holds "
            f"below {LITTLE:g}).",
            max(reverse) < LITTLE,
        ),
    ]


def _error(found: Sequence[float], wanted: Sequence[float]) -> float:
    return max(abs(value / right - 1) for value, right in zip(found, wanted))


def _cost_table(lenses: Rows) -> Table:
    rows = [
        (
            f"{row['coefficients']}",
            f"{row['loss']:.3f}",
            f"{row['reverse_mode']:.3f} ({row['reverse_mode'] / row['loss']:.1f} x)",
            f"{row['forward_mode']:.3g} ({row['forward_mode'] / row['loss']:.3g} x)",
            f"{row['central']:.3g} ({row['central'] / row['loss']:.3g} x)",
            f"{row['central_apart']:.0e}",
        )
        for row in lenses
    ]
    return Table(
        "The whole gradient of the lens: seconds, and times of the loss alone. The error is the greatest "
        "difference from reverse mode, over the gradient's greatest entry.",
        (
            "coefficients",
            "loss, s",
            "reverse mode, s",
            "forward mode, s, extrapolated",
            "central differences, s, extrapolated",
            "error of central differences",
        ),
        rows,
    )


def _noise(noisy: Rows) -> Table:
    rows = [
        (
            f"{row['coefficients']}",
            f"{row['paths']:g}",
            f"{row['cosine']:.4f}" if row["installed"] else "not installed",
        )
        for row in noisy
    ]
    return Table(
        "Gradients by Mitsuba's `ptracer` have noise: cosine of the angle to the exact gradient.",
        ("coefficients", "light paths per pixel", "cosine"),
        rows,
    )


def _choices() -> list[Choice]:
    return [
        Choice("values of d_o in Fig. 4.2", ", ".join(f"{d_o:g}" for d_o in D_O)),
        Choice(
            "operating point of the lens whose gradient is timed (no such run in the thesis)",
            "half the sag that optimal transport asks for; both images filtered by a Gaussian of 1 pixel",
        ),
    ]


def _span(rows: Sequence[dict[str, Any]], key: str, form: str) -> str:
    values = [row[key] for row in rows]
    return f"{min(values):{form}} to {max(values):{form}}"
