"""Pictures of study 6, in the arrangement of Figure 6.1."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LogNorm

from benchmarks.thesis.drawing import curves, mesh, panels, png, relief
from benchmarks.thesis.records import Found, Results

COLOURS = {"Adam": "C0", "Adam, one step": "C1", "L-BFGS": "C2"}
FAINTEST = 1e-4  # of the greatest vertex gradient: what is fainter is drawn black


def losses(results: Results) -> bytes:
    """Return the wanted surface, and the loss over iterations with Adam's steps and the least losses."""
    figure, ax = curves()
    inset = ax.inset_axes((0.01, 0.02, 0.22, 0.36))
    relief(inset, results["Adam"].arrays["target"], "height map")
    inset.set(xticks=[], yticks=[])
    for name, colour in COLOURS.items():
        at = 0
        for k, least in enumerate(results[name].numbers["least"]):
            values = results[name].arrays[f"losses{k}"]
            x = at + np.arange(len(values))
            ax.semilogy(x, values, colour, lw=1, label=name if k == 0 else None)
            if name == "Adam":
                ax.hlines(least, x[0], x[-1], "0.3", "--", lw=0.9)
                note = f"step {results[name].numbers['steps'][k]:g}"
                ax.text(x[0] + 5, least * 0.72, note, fontsize=7)
            at = x[-1]
    ax.set(xlabel="iteration", ylabel="loss (6.4)")
    ax.set_title(f"alpha = {results['Adam'].numbers['alpha']:g} after every batch", fontsize=9)
    ax.legend(frameon=False)
    return png(figure)


def states(found: Found) -> bytes:
    """Return rows of all batches: change of the surface, surface, mesh, vertex gradients."""
    arrays, dof = found.arrays, found.numbers["dof"]
    figure, axes = panels(4, len(dof))
    before = np.zeros_like(arrays["target"])
    for k, (change, surface, cells, gradients) in enumerate(axes.T):
        heights = arrays[f"heights{k}"]
        greatest = float(np.abs(heights - before).max())
        change.imshow((heights - before).T, "RdBu", origin="lower", vmin=-greatest, vmax=greatest)
        change.set_title(f"level {k}: change up to {greatest:.2g}", fontsize=8)
        relief(surface, heights, f"{dof[k]} control points")
        mesh(cells, arrays[f"boxes{k}"], arrays[f"levels{k}"], f"{len(arrays[f'boxes{k}'])} cells")
        size = np.abs(heights - arrays["target"]) / found.numbers["loss"][k]
        shown = np.maximum(size, FAINTEST * size.max()).T
        gradients.imshow(shown, "magma", origin="lower", norm=LogNorm(FAINTEST * size.max(), size.max()))
        gradients.set_title(f"|dL/dZ| up to {size.max():.2g}", fontsize=8)
        before = heights
    return png(figure)
