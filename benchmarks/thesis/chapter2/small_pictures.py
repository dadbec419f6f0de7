"""Pictures of study 9: Figures 2.3 and 2.6."""

from __future__ import annotations

import numpy as np

from benchmarks.thesis.drawing import panels, png
from benchmarks.thesis.records import Found, Results
from examples.thesis.small_figures import PIXELS, box, gaussian

CURVES = (("t_s", "--", "$T_s$"), ("t_p", "-.", "$T_p$"), ("t_u", "-", "$T_u$, traced"))
MIDDLE = PIXELS // 2


def fresnel(results: Results) -> bytes:
    """Return the transmittances by the angle of incidence, into glass and out of it."""
    figure, axes = panels(1, 2, size=3.8)
    for ax, (run, title) in zip(axes[0], (("into glass", "(a) 1 to 1.5"), ("out of glass", "(b) 1.5 to 1"))):
        numbers, arrays = results[run].numbers, results[run].arrays
        degrees = np.linspace(0, 90, len(arrays["t_s"]), endpoint=False)
        for key, style, label in CURVES:
            ax.plot(degrees, arrays[key], style, lw=1.2, label=label)
            ax.plot(degrees, 1 - arrays[key], style, lw=0.8, color="0.6", label=label.replace("T", "R"))
        for angle, name in ((numbers["brewster"], "Brewster"), (numbers["critical"], "critical")):
            if angle is not None:
                ax.axvline(angle, color="0.4", lw=0.7, ls=":")
                ax.text(
                    angle + (2 if name == "critical" else -4),
                    0.4,
                    f"{name}: {angle:.2f}",
                    rotation=90,
                    fontsize=7,
                    va="center",
                )
        ax.set(xlim=(0, 90), ylim=(0, 1.02), xticks=range(0, 91, 15), yticks=np.linspace(0, 1, 6))
        ax.set_xlabel("angle of incidence / degrees")
        ax.set_title(title, fontsize=9)
    axes[0, 0].legend(frameon=False, fontsize=7, loc="center left")
    return png(figure)


def pixel(found: Found) -> bytes:
    """Return filters and rays, the rays weighed for the pixel in the middle, and the pixels."""
    figure, axes = panels(2, 3, size=3.0)
    positions, x = found.arrays["positions"], np.linspace(0, PIXELS, 1001)
    names = (("box", box), ("gaussian", gaussian))
    for row, (filters, rays, pixels), (name, window) in zip("12", axes, names):
        for k in range(PIXELS):
            colour = "C3" if k == MIDDLE else "0.6"
            filters.plot(x, window(x - k - 0.5), color=colour, lw=1.4 if k == MIDDLE else 0.9)
        filters.vlines(positions, 0, 0.25, "C0", lw=0.8)
        filters.set_title(f"(a{row}) {name} filters; rays of equal radiance", fontsize=8)
        rays.plot(x, window(x - MIDDLE - 0.5), "C3", lw=1)
        rays.vlines(positions, 0, found.arrays[name][MIDDLE], "C0", lw=0.8)
        rays.set_title(f"(b{row}) weights of the rays for $P_{MIDDLE}$", fontsize=8)
        pixels.bar(
            range(PIXELS),
            found.numbers[name],
            0.9,
            color=["C3" if k == MIDDLE else "0.7" for k in range(PIXELS)],
        )
        pixels.set_title(f"(c{row}) $P_{MIDDLE}$ = {found.numbers[name][MIDDLE]:.2f}", fontsize=8)
        pixels.set(
            xticks=range(PIXELS), xticklabels=[f"$P_{k}$" for k in range(PIXELS)], yticks=range(0, 13, 4)
        )
    return png(figure)
