"""The picture of `thbcad etendue` (matplotlib)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from optics.report.canvas import plt, png_bytes

if TYPE_CHECKING:
    from optics.etendue import ImageBound
    from optics.target import Screen


def bound_figure(bound: ImageBound, screen: Screen) -> bytes:
    """Draw the target irradiance, the best irradiance made of images of the source, and such an image.

    All have the same scale.
    """
    unit = "degrees" if screen.angular else "mm"
    top, (hx, hy) = float(bound.target.max()), screen.half_width
    # the image of the source in the middle of the target
    rows, columns = bound.target.shape
    k, l = bound.kernel.shape
    source = np.zeros(bound.target.shape)
    r, c = (rows - k) // 2, (columns - l) // 2
    source[r : r + k, c : c + l] = bound.kernel / bound.kernel.max()
    pictures = [
        ("asked for", bound.target / top),
        (f"best light: {bound.attained:.1%} off, at least {bound.lower_bound:.1%}", bound.image / top),
        ("the source's image", source),
    ]
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.2), layout="constrained", sharey=True)
    for panel, (title, image) in zip(axes, pictures):
        shown = panel.imshow(
            image, cmap="gray", vmin=0, vmax=1, extent=(-hx, hx, -hy, hy), interpolation="nearest"
        )
        panel.set_title(title, fontsize=10)
        panel.set_xlabel(f"x / {unit}")
    axes[0].set_ylabel(f"y / {unit}")
    figure.colorbar(shown, ax=list(axes), label="light / brightest asked for")
    return png_bytes(figure)
