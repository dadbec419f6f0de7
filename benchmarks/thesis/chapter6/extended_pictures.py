"""The pictures of study 8."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.checkout import EXAMPLES
from benchmarks.thesis.chapter6.batch_pictures import batch_rows, ends, lens_views, loss_curves, scene
from benchmarks.thesis.chapter6.batch_records import unpacked
from benchmarks.thesis.drawing import curves, png
from benchmarks.thesis.records import Results
from optics.problem import load_problem
from optics.system import OpticalSystem

CURVES = {"symmetric mesh": "thb", "mesh not symmetric": "asymmetric", "target filtered too": "filtered"}
COLUMNS = {
    "symmetric mesh": "thb",
    "not symmetric": "asymmetric",
    "T filtered": "filtered",
    "own, one surface": "one free surface",
    "own, two surfaces": "two free surfaces",
}


def pictures(results: Results) -> Iterator[tuple[str, bytes]]:
    """Yield names and PNG."""
    thb = results["thb"]
    yield "study8_thb", batch_rows(thb)
    yield "study8_loss", _losses(results)
    wanted = thb.arrays["wanted"]
    yield "study8_ends", ends({title: results[name] for title, name in COLUMNS.items()}, wanted)
    pixels = list(wanted.shape[::-1])
    problem = load_problem(EXAMPLES / "thesis" / "extended.toml").with_(**{"target.pixels": pixels})
    system = OpticalSystem(problem)
    yield "study8_lens", lens_views(system.lens, unpacked(thb.arrays["lens"]))
    yield "study8_scene", scene(system, thb)


def _losses(results: Results) -> bytes:
    figure, ax = curves()
    numbers = results["thb"].numbers
    loss_curves(ax, {title: results[name] for title, name in CURVES.items()}, ("symmetric mesh",))
    ends_of_batches = numbers["iterations"] * (1 + np.arange(len(numbers["step"])))
    ax.plot(ends_of_batches, numbers["loss_of_check"], "kx", ms=4)
    return png(figure)
