"""Study 6: a height map by an optimiser and refinement, beside least squares on the same meshes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import optics
from benchmarks.thesis.chapter6 import height_map_pictures
from benchmarks.thesis.pages import Choice, Claim, Picture, Section, Table
from benchmarks.thesis.records import Found, Numbers, Results, Run
from examples.height_map import ALPHA, GRID, Mean, error, indicator, leaf_mean, refined, uniform
from examples.thesis.height_map_by_adam import SAMPLES, STEPS, Batch, batches
from thbcad import THBSpace

NUMBER = 6
TITLE = "A height map by an optimiser and refinement"
ITERATIONS = {True: 100, False: 150}  # of a batch; 150 are the thesis's
ONE_STEP = 0.02  # of Adam in all batches, as a control
CLOSE = 0.05  # an excess that does not matter: the next mesh has a least loss smaller by a third or more
KNOTS = 14  # of the first mesh in each direction: m_u = m_v in (6.3)

Floats = NDArray[np.float64]


def runs(quick: bool) -> list[Run]:
    """Return the runs: least squares, Adam, and its controls."""
    steps = ITERATIONS[quick]
    falling = [optics.Adam(step) for step in STEPS]
    constant = [optics.Adam(ONE_STEP)] * len(STEPS)
    return [
        Run("least squares", lambda _: least_squares_fits()),
        Run("Adam", lambda _: optimised(falling, STEPS, steps)),
        Run("Adam, one step", lambda _: optimised(constant, [ONE_STEP] * len(STEPS), steps)),
        Run("Adam, printed mean", lambda _: optimised(falling, STEPS, steps, printed_mean)),
        Run("L-BFGS", lambda _: optimised([optics.LBFGS()] * len(STEPS), [], steps)),
    ]


def pictures(results: Results) -> Iterator[tuple[str, bytes]]:
    """Yield the curves of the loss, and the states of Adam's surface."""
    yield "study6_loss", height_map_pictures.losses(results)
    yield "study6_batches", height_map_pictures.states(results["Adam"])


def least_squares_fits() -> Found:
    """Return control points and rms error of the least-squares fits of examples/height_map.py."""
    numbers = {}
    for name, surfaces in (("thb", refined(SAMPLES)), ("uniform", uniform(SAMPLES))):
        numbers[f"{name}_dof"] = [surface.space.dim for surface in surfaces]
        numbers[f"{name}_rms"] = [error(surface, SAMPLES) for surface in surfaces]
    return Found(numbers)


def printed_mean(space: THBSpace, sums: Floats) -> Floats:
    """Return the mean of (6.3) as it is printed, for every cell.

    It is the sum over the cells of the cell's level l, over 2^l m_u m_v.
    """
    level = space.cells[:, 0]
    totals = np.bincount(level, sums)
    return totals[level] / (2.0**level * KNOTS**2)


def optimised(
    optimisers: list[optics.Optimiser], steps: Sequence[float], iterations: int, mean: Mean = leaf_mean
) -> Found:
    """Return what an optimiser reaches in every batch, and the surfaces of all batches.

    steps : the optimisers' step sizes, none where they have none.
    """
    done = batches(optimisers, iterations, mean)
    found = [_batch_numbers(batch, mean) for batch in done]
    numbers: dict[str, Any] = {key: [row[key] for row in found] for key in found[0]}
    arrays = {"target": SAMPLES.values.reshape(len(GRID), -1).astype(np.float32)}
    for k, batch in enumerate(done):
        arrays[f"losses{k}"] = np.array(batch.losses)
        arrays[f"heights{k}"] = batch.surface.grid(GRID, GRID).astype(np.float32)
        arrays[f"boxes{k}"] = batch.surface.space.boxes
        arrays[f"levels{k}"] = batch.surface.space.cells[:, 0]
    return Found({**numbers, "steps": list(steps), "alpha": ALPHA, "iterations": iterations}, arrays)


def _batch_numbers(batch: Batch, mean: Mean) -> dict[str, float]:
    """Return what a batch reached, and which part of the surface (6.3) marks after it.

    area, gradients : the marked cells' shares of the surface and of the vertex gradients.
    ratio : the mean that (6.3) compares with, over the mean of all leaf cells; its mean over the cells.
    """
    space, sums = batch.surface.space, indicator(batch.surface, SAMPLES)
    marked = sums > ALPHA * mean(space, sums)
    u0, u1, v0, v1 = space.boxes.T
    return {
        "dof": space.dim,
        "evaluations": len(batch.losses),
        "loss": min(batch.losses),
        "least": batch.least,
        "rms": error(batch.surface, SAMPLES),
        "area": float(((u1 - u0) * (v1 - v0))[marked].sum()),
        "gradients": float(sums[marked].sum() / sums.sum()),
        "ratio": float(np.mean(mean(space, sums)) / sums.mean()),
    }


def section(results: Results) -> Section:
    """Return what the page says."""
    adam = results["Adam"].numbers
    return Section(
        NUMBER,
        TITLE,
        [
            "A cubic THB-spline is fitted to a height map of 225 x 225 vertices. The loss is (6.4), the norm "
            "of the residuals. The start is zero, with 10 x 10 control points. Adam makes "
            f"{adam['iterations']} steps on each of five meshes. After each batch those cells are refined "
            f"whose sum of vertex gradients exceeds {ALPHA:g} times the mean over the leaf cells.",
            "The residual is linear in the control points. So least squares gives the least loss of every "
            "mesh. The excess of an optimiser is its loss over that least loss, less one.",
            "Controls: Adam with one step for all batches, L-BFGS, and the threshold of (6.3) as printed.",
        ],
        [*_fit_claims(results), *_refinement_claims(results)],
        [_fits(results), _meshes(results)],
        [
            Picture(
                "study6_loss",
                "The height map, and the loss over iterations (Figure 6.1 a1, b1). Broken lines are the "
                "least losses of Adam's meshes.",
            ),
            Picture(
                "study6_batches",
                "The five batches of Adam from left to right (Figure 6.1 a2 to e5): change of the surface in "
                "the batch, the surface, the mesh, and the sizes of the vertex gradients at its end.",
            ),
        ],
        _choices(),
    )


def _excess(numbers: Numbers) -> list[float]:
    return [loss / least - 1 for loss, least in zip(numbers["loss"], numbers["least"])]


def _fit_claims(results: Results) -> list[Claim]:
    """Return the claims of how well the surface is fitted."""
    adam, fits = results["Adam"].numbers, results["least squares"].numbers
    excess = _excess(adam)
    larger = int(np.searchsorted(fits["uniform_dof"], adam["dof"][-1]))
    dof, rms = fits["uniform_dof"][larger], fits["uniform_rms"][larger]
    return [
        Claim(
            "Every batch adds detail of higher resolution, and the loss falls.",
            "6.2, Figure 6.1 b1",
            f"The loss at the ends of the batches is {_listed(adam['loss'], '.3g')}. "
            "It holds if every batch ends below the one before.",
            bool(np.all(np.diff(adam["loss"]) < 0)),
        ),
        Claim(
            "Automated refinement fits the height map effectively.",
            "6.2",
            f"{adam['dof'][-1]} control points end with an rms error of {adam['rms'][-1]:.2g}. The next "
            f"larger uniform mesh has {dof}, and {rms:.2g} by least squares. It holds if the error is the "
            "smaller one.",
            adam["rms"][-1] < rms,
        ),
        Claim(
            "An optimiser reaches a good fit of a mesh within the steps of one batch.",
            "6.2, implied: a batch ends after a fixed number of steps",
            f"Adam ends {_listed(excess, '.2%')} above the least loss of its meshes. "
            f"It holds if no batch is more than {CLOSE:.0%} above.",
            max(excess) < CLOSE,
        ),
    ]


def _refinement_claims(results: Results) -> list[Claim]:
    """Return the claims of where the surface is refined."""
    adam = results["Adam"].numbers
    area, gradients = (adam[key][:-1] for key in ("area", "gradients"))  # nothing follows the last batch
    ratios = results["Adam, printed mean"].numbers["ratio"]
    return [
        Claim(
            "Regions of high vertex gradients are those that are refined.",
            "6.2, Figure 6.1 a4 to e5",
            f"The marked cells cover {_listed(area, '.0%')} of the surface and hold "
            f"{_listed(gradients, '.0%')} of the vertex gradients. It holds if their share of the gradients "
            "is the greater one after every batch.",
            all(g > a for g, a in zip(gradients, area)),
        ),
        Claim(
            "(6.3) compares a cell with alpha times the average.",
            "6.1, (6.3)",
            "What is printed, the sum over one level over 2^l m_u m_v, is "
            f"{_listed(ratios, '.2g')} times the mean over the leaf cells after the five batches. "
            "It holds if that is 1 within 10%.",
            all(abs(ratio - 1) < 0.1 for ratio in ratios),
        ),
    ]


def _fits(results: Results) -> Table:
    """Return the ends of the batches of Adam, and of the last batch of the others."""
    rows = []
    for name in ("Adam", "Adam, one step", "Adam, printed mean", "L-BFGS"):
        n = results[name].numbers
        excesses = _excess(n)
        for k in range(len(excesses)) if name == "Adam" else (len(excesses) - 1,):
            step = f"{n['steps'][k]:g}" if n["steps"] else ""
            losses = (
                f"{n['loss'][k]:.4g}",
                f"{n['least'][k]:.4g}",
                f"{excesses[k]:.2%}",
                f"{n['rms'][k]:.2g}",
            )
            rows.append((name, str(k), step, str(n["dof"][k]), *losses))
    head = ("run", "level", "step", "DOF", "loss", "least loss", "excess", "rms error")
    return Table(
        "Ends of the batches, of the controls of the last. The least loss is that of least squares on the "
        "same mesh.",
        head,
        rows,
    )


def _meshes(results: Results) -> Table:
    """Return least squares with both refinements, which no optimiser enters."""
    n = results["least squares"].numbers
    keys = ("thb_dof", "thb_rms", "uniform_dof", "uniform_rms")
    rows = [
        (str(k), str(a), f"{b:.2g}", str(c), f"{d:.2g}")
        for k, (a, b, c, d) in enumerate(zip(*(n[key] for key in keys)))
    ]
    head = ("level", "THB control points", "rms error", "uniform control points", "rms error")
    return Table("Least squares at every level, with THB and with uniform refinement.", head, rows)


def _choices() -> list[Choice]:
    return [
        Choice("height map of Figure 6.1, in a picture only", "the formula of examples/height_map.py"),
        Choice("vertices of the height map", "225 x 225"),
        Choice("step sizes of Adam per batch, in a figure only", _listed(STEPS, "g")),
        Choice("alpha per batch, in a figure only", f"{ALPHA:g} in all batches"),
    ]


def _listed(values: Sequence[float], form: str) -> str:
    return ", ".join(f"{value:{form}}" for value in values)
