"""The page of study 5."""

from __future__ import annotations

import numpy as np

from benchmarks.thesis.chapter5.networks_claims import NEAR, claims, least, reached, with_seeds
from benchmarks.thesis.chapter5.networks_runs import KINDS, SEEDED
from benchmarks.thesis.pages import Choice, Picture, Section, Table
from benchmarks.thesis.records import Results

TITLE = "Networks as parametrisation"
HEAD = (
    "run",
    "iterations to the mark",
    "final loss",
    "rel_l2",
    "roughness",
    "move, um",
)
CHOICES = (
    Choice(
        "Net, lens, throw, degree and target of section 5.5.",
        "The plano lens of table 5.1, R = inf, d2 = 300 mm; degree 3, 24 x 24 control points; a disk of 35 "
        "mm on a target of half-width 50 mm; 128 x 128 pixels, Gaussian of 1 pixel.",
    ),
    Choice(
        "Scale of a network's outputs, and of the heights without network.",
        "z_freedom = 5 mm times the output. Without network the variable is z / z_freedom, so that a step "
        "means the same.",
    ),
    Choice("Number of layers of the sparse networks.", "Three, as of the dense one."),
    Choice("Uniform start of the sparse network.", "U(-1e-4, 1e-4), as of the dense one; biases too."),
    Choice("Random start.", "U(-a, a), a = 1 / sqrt(inputs of the neuron), for weights and biases."),
    Choice(
        "Epsilon of Adam.",
        "1e-12 of the first gradient's greatest entry, so that the loss's scale does not count.",
    ),
    Choice("Scale of the loss (5e-7 at the end in the thesis).", "Losses are compared by ratios."),
)


def section(results: Results) -> Section:
    """Return the page's section, from the numbers alone."""
    return Section(
        number=5,
        title=TITLE,
        text=_text(results),
        claims=claims(results),
        tables=[_main_table(results), _seed_table(results)],
        pictures=_pictures(),
        choices=CHOICES,
    )


def _text(results: Results) -> list[str]:
    n = round(results["NN 1e-3"].numbers["parameters"] ** 0.5)
    sparse, dense = (results[f"{kind} 1e-3"].numbers["parameters"] for kind in ("US", "UD"))
    seeds = len(with_seeds(results, "US", SEEDED[0]))
    return [
        f"A lens is to light a disk, from a flat start. Adam changes the heights of {n} x {n} control "
        "points directly (no network, NN), or the weights and biases of a network whose outputs are the "
        "heights. The network has three layers of as many neurons as there are control points, each with "
        "tanh, and a constant input. In the dense one (UD) every neuron takes all of the layer before. In "
        "the sparse ones (US, RS) it takes those whose splines overlap its own; every connection has its "
        f"own weight. Sparse networks have {sparse} parameters, the dense one {dense}. US and RS differ in "
        "the start only: small uniform weights, or weights of ordinary size.",
        "Scripts: [networks.py](../../examples/thesis/networks.py), "
        "[height_network.py](../../examples/thesis/height_network.py), "
        "[sparse_layers.py](../../examples/thesis/sparse_layers.py).",
        f"Other starts were run too, {seeds} seeds at steps {' and '.join(SEEDED)}. Controls: no network "
        "with larger steps; a fixed smoothing in place of the sparse network, z = t0 + S t1 + S^2 t2 with "
        "S the mean of the neighbours; L-BFGS; L-BFGS from the transport start.",
        f"The mark is {NEAR} times the least final loss of the thesis's runs. A move is the greatest change "
        "of a height in one iteration; the table has its median. " + _amplification(results),
        _transport(results),
    ]


def _amplification(results: Results) -> str:
    """Return what the networks make of a step."""
    moves = {kind: results[f"{kind} 1e-4"].numbers["usual_move"] for kind in ("NN", "US", "UD")}
    return (
        f"At a step of 1e-4 the dense network moves a height {moves['UD'] / moves['NN']:.0f} times as far in "
        f"an iteration as no network does, the sparse one {moves['US'] / moves['NN']:.1f} times as far."
    )


def _transport(results: Results) -> str:
    """Return what the start does, beside the parametrisation."""
    start = results["NN transport"].numbers
    return (
        f"From the transport start, L-BFGS without network ends at a loss of {start['loss']:.3f} and rel_l2 "
        f"{start['rel_l2']:.3f} after {start['evaluations']} evaluations, with roughness "
        f"{start['roughness']:.2f}. The least loss of all networks and steps of the thesis, from the flat "
        f"start, is {least(results):.3f}."
    )


def _main_table(results: Results) -> Table:
    names = [name for name in results if " seed " not in name]
    return Table("Runs of the thesis, and controls.", HEAD, [_row(results, name) for name in names])


def _row(results: Results, name: str) -> list[str]:
    r = results[name].numbers
    time = reached(results, name)
    return [
        name,
        "-" if time is None else f"{time}",
        f"{r['loss']:.4f}",
        f"{r['rel_l2']:.3f}",
        f"{r['roughness']:.2f}",
        f"{1e3 * r['usual_move']:.3g}",
    ]


def _seed_table(results: Results) -> Table:
    rows = []
    for kind in KINDS:
        for step in SEEDED:
            found = with_seeds(results, kind, step)
            losses = [row["loss"] for row in found]
            rows.append((f"{kind} {step}", *(f"{f(losses):.4f}" for f in (np.mean, min, max))))
    return Table("Final loss over seeds.", ("runs", "mean", "least", "greatest"), rows)


def _pictures() -> list[Picture]:
    return [
        Picture("study5_losses", "Loss against iterations (figure 5.12), and the controls."),
        Picture("study5_lenses", "Sags at the iterations of figure 5.13, and their range, steps of 1e-4."),
        Picture(
            "study5_irradiance",
            "Irradiance and its error at the same iterations (figures 5.14 to 5.17), steps of 1e-4. Red: "
            "too little light; blue: too much.",
        ),
    ]
