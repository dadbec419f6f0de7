"""The figure of the first pages: a crescent of light, the lens that makes it with its mesh, and the error
against the number of functions of locally refined and of uniform meshes.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from numpy.typing import NDArray
from PIL import Image

from benchmarks.rows.stored_rows import StoredRows
from thbcad import THBSpace, read_lens

CASE = "crescent"  # of `refinement`
SIZE, DPI = (10.4, 2.9), 150  # inches; the page shows half of these pixels
FINE, COARSE = "#d5641c", "#3b6ea5"  # colours of local refinement and of uniform meshes
STYLE = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}


def flagship(folder: Path, refinement: StoredRows) -> bytes:
    """Return the figure as WebP.

    folder : result of the crescent with local refinement.  refinement : the stored rows of that benchmark.
    """
    with np.load(folder / "irradiance.npz") as arrays:
        light, target = np.asarray(arrays["irradiance"]), np.asarray(arrays["target"])
    rear = read_lens(folder / "lens.json").rear
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 4, figsize=SIZE, layout="constrained", width_ratios=(1, 1, 1, 1.35))
        for axis, shown, title in zip(axes, (target, light), ("target", "light of the lens")):
            axis.imshow(shown / shown.mean(), cmap="gray", vmin=0, vmax=1.1 * (target / target.mean()).max())
            _bare(axis, title)
        _draw_mesh(axes[2], rear.sag.space)
        _draw_errors(axes[3], dict(refinement.named()))
        buffer = io.BytesIO()
        figure.savefig(buffer, dpi=DPI)
        plt.close(figure)
    out = io.BytesIO()
    Image.open(buffer).convert("RGB").save(out, "webp", quality=90, method=6)
    return out.getvalue()


def _bare(axis: Any, title: str) -> None:
    axis.set(xticks=[], yticks=[], title=title)
    axis.title.set_fontsize(9)
    axis.spines[:].set_visible(False)


def _draw_mesh(axis: Any, space: THBSpace) -> None:
    """Draw the cells of a mesh over the lens."""
    u0, u1, v0, v1 = space.boxes.T
    corners = ((u0, v0), (u1, v0), (u1, v1), (u0, v1), (u0, v0))
    outlines: NDArray[np.float64] = np.stack([np.stack(corner, axis=1) for corner in corners], axis=1)
    axis.add_collection(LineCollection(list(outlines), colors=FINE, linewidths=0.3))
    axis.set(xlim=(u0.min(), u1.max()), ylim=(v0.min(), v1.max()), aspect="equal")
    _bare(axis, f"mesh over the lens: {space.dim:,} functions".replace(",", " "))


def _draw_errors(axis: Any, rows: Mapping[str, Mapping[str, Any]]) -> None:
    """Draw the relative error of every mesh over its functions."""
    for kind, colour, label in (
        ("uniform level", COARSE, "uniform"),
        ("vertex, alpha", FINE, "refined locally"),
    ):
        functions, errors = np.array(sorted(_points(rows, kind))).T
        axis.loglog(functions, 100 * errors, "o-", color=colour, label=label, markersize=4)
    axis.set(xlabel="functions", ylabel="error / %")
    axis.set_xticks([2000, 5000, 10000, 20000, 50000], ["2000", "5000", "10 000", "20 000", "50 000"])
    axis.set_xticks([], minor=True)
    axis.yaxis.set_minor_formatter("{x:g}")
    axis.yaxis.set_major_formatter("{x:g}")
    axis.legend(frameon=False)


def _points(rows: Mapping[str, Mapping[str, Any]], kind: str) -> Iterable[tuple[float, float]]:
    """Yield (functions, rel_l2) of the meshes of a kind."""
    for name, row in rows.items():
        if re.fullmatch(rf"{CASE}: {kind} [\d.]+: degrees of freedom", name):
            mesh = name.removesuffix("degrees of freedom")
            yield float(row["value"]), float(rows[f"{mesh}rel_l2"]["value"])
