"""The two pictures of intensity that lighting engineers read: polar curves and lines of equal intensity."""

from math import ceil
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.projections.polar import PolarAxes

from optics.reporting.figures.canvas import plt, png_bytes
from optics.reporting.view import block_means
from optics.scene.photometry import Density, plane_curves
from optics.scene.receivers import Screen
from thbcad.checks import Floats

SIZE = (5.2, 4.8)  # inches
LOOKS = {"C0-C180": ("tab:blue", 2.4), "C90-C270": ("tab:orange", 1.1)}  # the first is seen behind the second
STEPS = (1, 2, 5, 10, 15, 30)  # degrees between the rays of a polar diagram
MOST_STEPS = 6  # of them on either side
# of the peak, at which lines of equal intensity are drawn; higher ones show ripple
SHARES = (0.1, 0.25, 0.5, 0.75)
LINES = plt.get_cmap("viridis")(np.linspace(0, 0.85, len(SHARES)))  # lighter ones are hard to see
FINEST = 128  # pixels of these lines in each direction: finer ones show ripples, not the beam


def intensity_figures(
    intensity: Floats, target: Floats, screen: Screen, density: Density
) -> dict[str, tuple[str, bytes]]:
    """Return (caption, PNG) of the polar diagram and of the isocandela diagram of a far field.

    intensity, target : (rows, columns), in the stored unit of `density`.  screen : the target's, in degrees.
    """
    light, wanted = density.factor * intensity, density.factor * target
    hx, hy = screen.half_width
    covers = f"It covers the target, +-{hx:g} degrees in x and +-{hy:g} in y, not the whole sphere."
    return {
        "polar": (
            f"Intensity in {density.shown} over gamma, the angle to the target's own +z; right are C0 "
            f"(towards its +x) and C90 (towards its -y). {covers}",
            _polar(light, wanted, screen, density.shown),
        ),
        "isocandela": (
            f"Lines of equal intensity (isocandela diagram); the peak is {light.max():.4g} {density.shown}; "
            f"dashed: asked for. {covers}",
            _isocandela(light, wanted, screen, density.shown),
        ),
    }


def _polar(light: Floats, wanted: Floats, screen: Screen, unit: str) -> bytes:
    figure = plt.figure(figsize=SIZE, layout="constrained")
    axes = cast("PolarAxes", figure.add_subplot(projection="polar"))
    for image, style, words in ((light, "-", "made"), (wanted, "--", "asked for")):
        for plane, curve in plane_curves(image, *screen.centres).items():
            colour, width = LOOKS[plane]
            axes.plot(
                np.radians(curve.gamma),
                curve.intensity,
                style,
                lw=width,
                color=colour,
                label=f"{plane}, {words}",
            )
    axes.set_theta_zero_location("S")
    _angles(axes, max(screen.half_width))
    axes.set_rlim(0, 1.05 * max(light.max(), wanted.max()))
    figure.legend(title=f"intensity in {unit}", fontsize=8, loc="outside lower center", ncols=2)
    return png_bytes(figure)


def _angles(axes: PolarAxes, widest: float) -> None:
    """Let a polar diagram end at round angles, with the same words on both sides."""
    step = next((s for s in STEPS if widest <= MOST_STEPS * s), STEPS[-1])
    end = step * ceil(widest / step)
    axes.set_thetamin(-end)
    axes.set_thetamax(end)
    axes.set_thetagrids(
        range(-end, end + 1, step), [f"{abs(a)}\N{DEGREE SIGN}" for a in range(-end, end + 1, step)]
    )


def _isocandela(light: Floats, wanted: Floats, screen: Screen, unit: str) -> bytes:
    figure, axes = plt.subplots(figsize=SIZE, layout="constrained")
    levels = np.array(SHARES) * light.max()
    _lines(axes, wanted, screen, levels, "dashed")
    _lines(axes, light, screen, levels, "solid")
    words = [f"{level:.4g} {unit} ({share:.0%} of the peak)" for level, share in zip(levels, SHARES)]
    named = [Line2D([], [], color=colour, label=text) for colour, text in zip(LINES, words)]
    figure.legend(handles=named, fontsize=8, loc="outside lower center", ncols=2)
    axes.set(
        aspect="equal", xlabel="angle towards +x (C0) / degrees", ylabel="angle towards +y (C270) / degrees"
    )
    axes.grid(alpha=0.3)
    return png_bytes(figure)


def _lines(axes: Axes, image: Floats, screen: Screen, levels: Floats, style: str) -> None:
    """Draw the lines of an image whose pixels are merged to at most FINEST in each direction."""
    side = -(-max(image.shape) // FINEST)
    u, v = (block_means(centres[None], side)[0] for centres in screen.centres)
    shown = block_means(image, side)
    if levels.any():  # a dark target has no lines
        axes.contour(u, v, shown, levels=levels, colors=LINES, linewidths=1.1, linestyles=style)
