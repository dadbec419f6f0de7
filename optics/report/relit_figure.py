"""The picture of `thbcad relight`: asked for, as designed, and in other light (matplotlib)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from optics.report.canvas import plt, png_bytes

if TYPE_CHECKING:
    from optics.analysis import Measurement
    from optics.target import Screen


def relit_figure(designed: Measurement, other: Measurement, screen: Screen, words: str) -> bytes:
    """Draw three pictures over their means, on one scale.

    words : for the other light.
    """
    unit, (hx, hy) = "degrees" if screen.angular else "mm", screen.half_width
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
