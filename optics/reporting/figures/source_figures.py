"""The pictures of `thbcad etendue`, both rungs, and of `thbcad relight` (matplotlib)."""

from __future__ import annotations

import numpy as np

from optics.designing.etendue import ImageBound, UniversalBound
from optics.light.analysis import Measurement
from optics.reporting.figures.canvas import plt, png_bytes
from optics.reporting.figures.overview import draw_pictures
from optics.scene.receivers import Screen


def bound_figure(universal: UniversalBound, bound: ImageBound, screen: Screen) -> bytes:
    """Draw the target irradiance, the best irradiance of one blur and its image of the source, and the least
    rel_l2 of any lens over its efficiency.

    The pictures have the same scale.
    """
    top = float(bound.target.max())
    # the image of the source in the middle of the target
    rows, columns = bound.target.shape
    k, l = bound.kernel.shape
    source = np.zeros(bound.target.shape)
    r, c = (rows - k) // 2, (columns - l) // 2
    source[r : r + k, c : c + l] = bound.kernel / bound.kernel.max()
    one_blur = f"one blur everywhere: {bound.attained:.1%} off, at least {bound.lower_bound:.1%}"
    named = [("asked for", bound.target / top), (one_blur, bound.image / top), ("that blur", source)]
    pictures = [(title, image, "gray", 0.0, 1.0) for title, image in named]
    figure, axes = plt.subplots(1, 4, figsize=(17, 4.2), layout="constrained")
    shown = draw_pictures(axes, pictures, screen.half_width, screen.unit)
    figure.colorbar(shown[-1], ax=list(axes[:3]), label="light / brightest asked for")
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
    named = [
        ("asked for", designed.target),
        (f"as designed: rel_l2 {designed.metrics['rel_l2']:.3f}", designed.irradiance),
        (f"{words}: rel_l2 {other.metrics['rel_l2']:.3f}", other.irradiance),
    ]
    top = float((designed.target / designed.target.mean()).max())
    pictures = [(title, image / image.mean(), "gray", 0.0, top) for title, image in named]
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.4), layout="constrained")
    shown = draw_pictures(axes, pictures, screen.half_width, screen.unit)
    figure.colorbar(shown[-1], ax=list(axes), label="light / mean")
    return png_bytes(figure)
