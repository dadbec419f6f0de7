"""The pictures of `thbcad etendue`, both rungs, and of `thbcad relight` (matplotlib)."""

from __future__ import annotations

import numpy as np

from optics.designing.etendue import ImageBound, UniversalBound
from optics.light.analysis import Measurement
from optics.reporting.figures.canvas import plt, png_bytes
from optics.scene.receivers import Screen


def bound_figure(universal: UniversalBound, bound: ImageBound, screen: Screen) -> bytes:
    """Draw the target irradiance, the best irradiance of one blur and its image of the source, and the least
    rel_l2 of any lens over its efficiency.

    The pictures have the same scale.
    """
    unit = screen.unit
    top, (hx, hy) = float(bound.target.max()), screen.half_width
    # the image of the source in the middle of the target
    rows, columns = bound.target.shape
    k, l = bound.kernel.shape
    source = np.zeros(bound.target.shape)
    r, c = (rows - k) // 2, (columns - l) // 2
    source[r : r + k, c : c + l] = bound.kernel / bound.kernel.max()
    pictures = [
        ("asked for", bound.target / top),
        (
            f"one blur everywhere: {bound.attained:.1%} off, at least {bound.lower_bound:.1%}",
            bound.image / top,
        ),
        ("that blur", source),
    ]
    figure, axes = plt.subplots(1, 4, figsize=(17, 4.2), layout="constrained")
    for panel, (title, image) in zip(axes, pictures):
        shown = panel.imshow(
            image, cmap="gray", vmin=0, vmax=1, extent=(-hx, hx, -hy, hy), interpolation="nearest"
        )
        panel.set_title(title, fontsize=10)
        panel.set_xlabel(f"x / {unit}")
    axes[0].set_ylabel(f"y / {unit}")
    figure.colorbar(shown, ax=list(axes[:3]), label="light / brightest asked for")
    points = [(efficiency, least) for efficiency, least in universal.curve() if least is not None]
    axes[3].plot([e for e, _ in points], [least for _, least in points], marker="o")
    axes[3].set(
        xlim=(0, 1.02), xlabel="efficiency", ylabel="rel_l2", title="least of any lens in the envelope"
    )
    return png_bytes(figure)


def relit_figure(designed: Measurement, other: Measurement, screen: Screen, words: str) -> bytes:
    """Draw three pictures over their means, on one scale.

    words : for the other light.
    """
    unit, (hx, hy) = screen.unit, screen.half_width
    pictures = [
        ("asked for", designed.target),
        (f"as designed: rel_l2 {designed.metrics['rel_l2']:.3f}", designed.irradiance),
        (f"{words}: rel_l2 {other.metrics['rel_l2']:.3f}", other.irradiance),
    ]
    top = float((designed.target / designed.target.mean()).max())
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.4), layout="constrained")
    for panel, (title, image) in zip(axes, pictures):
        shown = panel.imshow(
            image / image.mean(),
            cmap="gray",
            vmin=0,
            vmax=top,
            extent=(-hx, hx, -hy, hy),
            interpolation="nearest",
        )
        panel.set_title(title, fontsize=10)
        panel.set_xlabel(f"x / {unit}")
    axes[0].set_ylabel(f"y / {unit}")
    figure.colorbar(shown, ax=list(axes), label="light / mean")
    return png_bytes(figure)
