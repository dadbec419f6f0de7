"""Figures: the pixels that matplotlib draws, whole meshes, and labels that a reader can read."""

import io
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.collections import LineCollection
from PIL import Image

from optics.report import figures
from optics.report.figures import DPI, lens_figures, new_figure, png_bytes
from tests.optics.verification.cases import shaped


def pixels(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), float)


def test_a_picture_holds_the_pixels_that_matplotlib_saves():
    figure, axes = new_figure()
    axes.plot([0, 1, 3], [2, 0, 1])
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    png = png_bytes(figure)
    assert (pixels(png) == pixels(buffer.getvalue())).all()
    assert Image.open(io.BytesIO(png)).info["dpi"] == pytest.approx((DPI, DPI), rel=1e-3)
    assert not plt.get_fignums()


def test_the_mesh_shows_every_cell_of_every_level(tmp_path, monkeypatch):
    """Against lines drawn cell by cell, which differ where two cells share a side."""
    _, lens = shaped(tmp_path)
    drawn = pixels(lens_figures(lens, ())["mesh"][1])

    def cell_by_cell(paths, facecolors, edgecolors, linewidths):
        sides = [
            (path.vertices.reshape(-1, 5, 2)[:, [0, 1, 2, 3, 0]], c) for path, c in zip(paths, edgecolors)
        ]
        return LineCollection(
            [cell for cells, _ in sides for cell in cells],
            colors=[c for cells, c in sides for _ in cells],
            linewidths=linewidths,
        )

    monkeypatch.setattr(figures, "PathCollection", cell_by_cell)
    wanted = pixels(lens_figures(lens, ())["mesh"][1])
    assert (wanted < 250).any(axis=2).sum() > 2000
    assert np.abs(drawn - wanted).mean() < 0.3  # of 255
    assert (((drawn < 250) != (wanted < 250)).any(axis=2)).mean() < 0.003


def test_the_misfit_is_labelled_by_plain_numbers(tmp_path, monkeypatch):
    labels = []

    def noted(figure):
        figure.canvas.draw()
        labels.extend(text.get_text() for text in figure.axes[0].get_yticklabels(which="both"))
        return png_bytes(figure)

    _, lens = shaped(tmp_path)
    rows = [SimpleNamespace(evaluation=k, fit=0.2 / (k + 1), level=k // 5) for k in range(10)]
    monkeypatch.setattr(figures, "png_bytes", noted)
    lens_figures(lens, rows)
    assert {"0.02", "0.1", "0.2"} <= set(labels)
