"""The curves of `thbcad bench error` as a picture: run time against error, log-log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.tracing.error_cases import Reference
from oracles.error_measures import Point


def draw(points: Sequence[Point], truths: Mapping[str, Reference], path: Path) -> None:
    """Write the picture: one column per lens, the irradiance above the gradient, the reference's own error
    dashed."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(truths), 7.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, len(truths), squeeze=False)
    names = list(dict.fromkeys(p.method for p in points))
    for column, (case, truth) in enumerate(truths.items()):
        for row, (seconds, error, own) in enumerate(
            (
                ("seconds", "error", truth.image_error),
                ("gradient_seconds", "gradient_error", truth.gradient_error),
            )
        ):
            axis = axes[row, column]
            for k, name in enumerate(names):
                curve = np.array(
                    [
                        (getattr(p, seconds), getattr(p, error))
                        for p in points
                        if p.case == case and p.method == name
                    ]
                )
                if np.isfinite(curve).any():
                    style = "--" if name.endswith("f32") else "-"
                    axis.loglog(
                        *curve.T, style, marker="os^vD"[k % 5], markersize=4, color=f"C{k}", label=name
                    )
            axis.axhline(own, color="0.5", linestyle=":", linewidth=1)
            axis.set_title(f"{case}: {('irradiance', 'gradient')[row]}", fontsize=10)
            axis.set_xlabel("s, one thread")
            axis.grid(which="major", color="0.9")
        axes[0, 0].set_ylabel("relative L2 error")
        axes[1, 0].set_ylabel("relative L2 error")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
