"""Two fans of eight rays through the lens of study 8, with all reflections, as in Figure 6.10."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from benchmarks.thesis.drawing import panels, png
from benchmarks.thesis.pages import Choice, Claim, Picture
from benchmarks.thesis.records import Found, Numbers
from optics.base.runtime import load_backend
from optics.light.analysis import fans
from optics.light.tracing import SENTENCES
from optics.scene.system import System
from thbcad import Lens

PICTURE = Picture(
    "study8_fans",
    "Rays from the middle of the source by equal angles and by equal steps of the sine (Figure 6.10). At "
    "every face the stronger part is followed. Green rays reach the target, red ones do not.",
)
CHOICE = Choice(
    "the linear sampling of the rays of Figure 6.10",
    "equal steps of the sine of the angle, up to 98% of 90 degrees",
)
MARGIN = 0.35  # of the lens's size, around it

Floats = NDArray[np.float64]


def traced(system: System) -> Found:
    """Return angle and fate of every ray, by fan, and their paths with the outline of the lens."""
    numbers: dict[str, dict[str, list[float] | list[str]]] = {}
    arrays = {"outline": _outline(system.designed)}
    for k, (name, paths) in enumerate(fans(system, load_backend()).items()):
        starts = [path.points[1] - path.points[0] for path in paths]
        angles = [float(np.degrees(np.arctan2(start[1], start[2]))) for start in starts]
        numbers[name] = {"angles": angles, "fates": [path.fate for path in paths]}
        arrays |= {f"path{k} {j}": path.points[:, [2, 1]] for j, path in enumerate(paths)}
    return Found({"fans": numbers}, arrays)


def claim(numbers: Numbers) -> Claim:
    """Return the verdict on where the steepest rays go."""
    words, parted = [], []
    for name, fan in numbers["fans"].items():
        steep = np.abs(fan["angles"])
        lost = np.array([not fate.endswith("on_target") for fate in fan["fates"]])
        ends = sorted({SENTENCES[fate] for fate in np.array(fan["fates"])[lost].tolist()})
        why = f" ({'; '.join(ends)})" if ends else ""
        most = f"up to {steep[~lost].max():.0f} degrees" if not lost.all() else "none"
        words.append(f"By {name} {lost.sum()} of {lost.size} rays miss{why}; those that arrive: {most}.")
        parted.append(bool(lost.any() and not lost.all() and steep[lost].min() > steep[~lost].max()))
    return Claim(
        "The rays at the highest angles do not reach the target. They leave by the front or by an edge.",
        "6.3.2, Figure 6.10",
        f"{' '.join(words)} It holds if in both fans every ray that misses is steeper than all that arrive.",
        all(parted),
    )


def picture(found: Found) -> bytes:
    """Return both fans in the plane x = 0."""
    figure, axes = panels(1, len(found.numbers["fans"]), size=4.2)
    for k, (ax, (name, fan)) in enumerate(zip(axes[0], found.numbers["fans"].items())):
        _lens(ax, found.arrays["outline"])
        for j, fate in enumerate(fan["fates"]):
            colour = "tab:green" if fate.endswith("on_target") else "tab:red"
            ax.plot(*found.arrays[f"path{k} {j}"].T, color=colour, lw=0.9)
        ax.set_title(name, fontsize=9)
    return png(figure)


def _lens(ax: Axes, outline: Floats) -> None:
    ax.fill(*outline.T, facecolor="0.92", edgecolor="0.3", lw=1)
    low, high = outline.min(0), outline.max(0)
    room = MARGIN * (high - low).max()
    ax.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")


def _outline(lens: Lens) -> Floats:
    """Return the section x = 0 of the lens as columns z, y, (n, 2)."""
    sides = []
    for surface, vertex, way in ((lens.front, 0.0, 1), (lens.rear, lens.thickness, -1)):
        y = np.linspace(-1, 1, 201)[::way] * surface.half_width[1]
        sides.append(np.stack([vertex + surface(np.zeros_like(y), y), y], axis=1))
    return np.concatenate(sides)
