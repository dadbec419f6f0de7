"""The pictures of study 8."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.checkout import EXAMPLES
from benchmarks.thesis.chapter6.batch_pictures import (
    batch_rows,
    ends,
    last_lens,
    lens_views,
    loss_curves,
    scene,
)
from benchmarks.thesis.drawing import curves, plt, png
from benchmarks.thesis.records import Results
from optics.base.runtime import load_backend
from optics.light.analysis import fans
from optics.reporting.figures import draw_fan
from optics.scene.problem import load_problem
from optics.scene.system import System

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
    system = System(problem)
    yield "study8_lens", lens_views(system.base, last_lens(system, thb))
    yield "study8_fans", _fans(system.with_lens(last_lens(system, thb)))
    yield "study8_scene", scene(system, thb)


def _fans(system: System) -> bytes:
    """Return two fans of rays from the middle of the source through the closed lens, as PNG."""
    figure, axes = plt.subplots(1, 2, figsize=(7.5, 3.6), layout="constrained")
    for ax, (name, fan) in zip(axes, fans(system, load_backend("double", None)).items()):
        draw_fan(ax, system.designed, fan)
        ax.set_title(name, fontsize=9)
        ax.set(xlabel="z / mm", ylabel="y / mm")
    return png(figure)


def _losses(results: Results) -> bytes:
    figure, ax = curves()
    numbers = results["thb"].numbers
    loss_curves(ax, {title: results[name] for title, name in CURVES.items()}, ("symmetric mesh",))
    ends_of_batches = numbers["iterations"] * (1 + np.arange(len(numbers["step"])))
    ax.plot(ends_of_batches, np.array(numbers["loss_of_check"], dtype=float), "kx", ms=4)
    return png(figure)
