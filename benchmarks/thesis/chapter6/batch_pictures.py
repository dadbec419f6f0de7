"""Pictures of the batches of a run, of its lens, and of the lit target, for studies 7 and 8."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter

from benchmarks.thesis.chapter6.batch_records import SHOWN, unpacked
from benchmarks.thesis.drawing import few_colours, irradiance, mesh, panels, plt, png, relief
from benchmarks.thesis.records import Found
from optics.base.runtime import load_backend
from optics.reporting.figures import draw_solid, scene_view
from optics.reporting.view import View, oblique, scene_paths, solid_faces
from optics.scene.system import System
from thbcad import Lens

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

SIZE = 1.55  # inches, of a panel
FAINT = 0.2  # the power of an irradiance that shows stray light
SCENE = 0.8  # of the size in which the scene is drawn
ROOM = 0.53  # half the width of a view of a lens, of the lens's extent
TURNS = {"left": (-35, 20), "centre": (0, 0), "right": (35, 20)}  # degrees to the right, and from above


def batch_rows(found: Found) -> bytes:
    """Return the rows of states of all batches as PNG: a column for each."""
    count, arrays = len(found.numbers["step"]), found.arrays
    missed = "missed 0" in arrays
    figure, axes = panels(5 + missed, count, SIZE)
    for k in range(count):
        numbers = {key: found.numbers[key][k] for key in ("dof", "loss")}
        difference, surface = arrays[f"difference {k}"], arrays[f"surface {k}"]
        relief(axes[0, k], difference, f"batch {k + 1}: change {np.ptp(difference):.2g} mm")
        relief(axes[1, k], surface, f"surface {np.ptp(surface):.2g} mm")
        mesh(axes[2, k], arrays[f"boxes {k}"], arrays[f"levels {k}"], f"{numbers['dof']:.0f} DOF")
        gradients(axes[3, k], arrays[f"vertices {k}"], "vertex gradients")
        irradiance(
            axes[4, k], arrays[f"irradiance {k}"], f"loss {numbers['loss']:.3f}", top=_top(arrays["wanted"])
        )
        if missed:
            axes[5, k].imshow(arrays[f"missed {k}"].T, origin="lower", cmap="Greys", vmax=1)
            axes[5, k].set_title("past the target", fontsize=8)
    return png(figure)


def ends(runs: dict[str, Found], wanted: np.ndarray) -> bytes:
    """Return the ends of runs as PNG: irradiance, the same to a small power, and the surface, a column each.

    wanted : the target irradiance, which is the first column.
    """
    figure, axes = panels(3, 1 + len(runs), SIZE)
    top = _top(wanted)
    irradiance(axes[0, 0], wanted, "target", top=top)
    irradiance(axes[1, 0], wanted, f"to the power {FAINT:g}", FAINT)
    axes[2, 0].set_axis_off()
    for k, (title, found) in enumerate(runs.items(), 1):
        irradiance(axes[0, k], found.arrays["light"], title, top=top)
        irradiance(axes[1, k], found.arrays["light"], "", FAINT)
        sag = unpacked(found.arrays["sag"])
        u, v = (np.linspace(kv.start, kv.stop, SHOWN) for kv in (sag.space.kv_u, sag.space.kv_v))
        relief(axes[2, k], sag.grid(u, v), "surface")
    return png(figure)


def lens_views(before: Lens, after: Lens) -> bytes:
    """Return a lens before and after from left, centre and right, as PNG."""
    figure, axes = plt.subplots(2, len(TURNS), figsize=(7.5, 5.4), layout="constrained")
    for row, (name, lens) in zip(axes, {"before": before, "after": after}.items()):
        faces, _ = solid_faces(lens)
        points = np.concatenate([face.points.reshape(3, -1) for face in faces], axis=1)
        for ax, (side, angles) in zip(row, TURNS.items()):
            turn = oblique(*angles)
            seen = turn[:2] @ points
            low, high = seen.min(axis=1), seen.max(axis=1)
            ax.set(xticks=[], yticks=[], frame_on=False)
            draw_solid(ax, faces, View(turn, (low + high) / 2, ROOM * (high - low).max()))
            ax.set_title(f"{side}, {name}", fontsize=9)
    return png(figure)


def last_lens(system: System, found: Found) -> Lens:
    """Return the lens that a run of batches ended with."""
    return system.base.with_sags([unpacked(found.arrays["sag"])])


def scene(system: System, found: Found) -> bytes:
    """Return source, lens and lit target as PNG."""
    lens = last_lens(system, found)
    paths = scene_paths(system.with_lens(lens), load_backend("double", None))
    light = np.asarray(found.arrays["light"], dtype=float)
    return few_colours(scene_view(system.with_lens(lens), light, paths), SCENE)


def loss_curves(ax: Axes, runs: dict[str, Found], marked: Sequence[str]) -> None:
    """Draw losses against iterations; the second tracer's loss is marked for some of the runs."""
    for k, (title, found) in enumerate(runs.items()):
        losses, iterations = found.arrays["losses"], found.numbers["iterations"]
        ax.semilogy(np.arange(len(losses)), losses, f"C{k}", lw=1, label=title)
        if title in marked:
            last = iterations * (1 + np.arange(len(found.numbers["step_loss"])))
            ax.semilogy(last, _drawn(found.numbers["step_loss"]), f"C{k}o", mfc="none", ms=6)
        for batch in range(1, len(found.numbers["step"])):
            ax.axvline(batch * iterations, color="0.8", lw=0.5, zorder=0)
    ax.set(xlabel="iteration", ylabel="loss")
    ax.legend(fontsize=7)
    plain_numbers(ax.yaxis)


def _drawn(losses: Sequence[float | None]) -> np.ndarray:
    return np.array(losses, dtype=float)  # None becomes NaN, which is not drawn


def plain_numbers(axis: Axis) -> None:
    """Label a logarithmic axis of less than two decades by 0.1, 0.2, 0.3, 0.5, 0.7 and the like."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 3, 5, 7)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def gradients(ax: Axes, values: np.ndarray, title: str) -> None:
    """Draw the sizes of vertex gradients (nx, ny), up to what all but 1 % stay below."""
    ax.imshow(values.T, origin="lower", cmap="inferno", vmin=0, vmax=float(np.quantile(values, 0.99)) or None)
    ax.set_title(title, fontsize=8)


def _top(wanted: np.ndarray) -> float:
    """Return the greatest target irradiance over the mean: white in all pictures."""
    return float(wanted.max() / wanted.mean())
