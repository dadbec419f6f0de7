"""Figures: the pixels that matplotlib draws, whole meshes, and labels that a reader can read."""

import io
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.collections import LineCollection
from PIL import Image

from optics.light.analysis import measure
from optics.reporting.figures import lens_and_light as figures
from optics.reporting.figures.canvas import DPI, block, new_figure, plane_figure, png_bytes
from optics.reporting.figures.lens_and_light import lens_figures, light_figures
from tests.optics.cases import small_lens, small_system
from tests.optics.exchange.verification.cases import shaped
from tests.optics.reporting.cases import pixels
from thbcad.lens import FreeformSurface, Lens

PLAN = [
    SimpleNamespace(name="level 3", screen=SimpleNamespace(pixels=(64, 32))),
    SimpleNamespace(name="finish", screen=SimpleNamespace(pixels=(256, 128))),
]


def test_a_picture_holds_the_pixels_that_matplotlib_saves():
    figure, axes = new_figure()
    axes.plot([0, 1, 3], [2, 0, 1])
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    png = png_bytes(figure)
    assert (pixels(png) == pixels(buffer.getvalue())).all()
    assert Image.open(io.BytesIO(png)).info["dpi"] == pytest.approx((DPI, DPI), rel=1e-3)
    assert not plt.get_fignums()


def test_figures_of_a_mirror_are_named_for_its_face():
    blank = Lens(small_lens().rear, FreeformSurface((10.0, 10.0)), 6.0, 1.0)
    assert list(lens_figures(blank, (), (), ("face", "back"))) == ["face_sag", "face_mesh", "loss"]
    assert list(lens_figures(blank, (), ())) == ["front_sag", "front_mesh", "loss"]


def test_the_mesh_shows_every_cell_of_every_level(tmp_path, monkeypatch):
    """Against lines drawn cell by cell, which differ where two cells share a side."""
    _, lens = shaped(tmp_path)
    drawn = pixels(lens_figures(lens, (), ())["mesh"][1])

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
    wanted = pixels(lens_figures(lens, (), ())["mesh"][1])
    assert (wanted < 250).any(axis=2).sum() > 2000
    assert np.abs(drawn - wanted).mean() < 0.3  # of 255
    assert (((drawn < 250) != (wanted < 250)).any(axis=2)).mean() < 0.003


# shape, half-widths, limits of the scale, and how many pixels of the figure a pixel takes in x and y: long
# numbers on every axis, an offset above the scale, odd shapes
PLANES = {
    "square": ((40, 40), (100.0, 100.0), (0.0, 1.0), (13, 13)),
    "long numbers": ((31, 57), (1234.5678, 671.4), (-1.23456e-3, 1.23456e-3), (9, 9)),
    "offset": ((64, 64), (0.0012, 0.0012), (1.0, 1.0 + 1e-9), (8, 8)),
    "narrow": ((200, 20), (1.0, 10.0), (0.0, 1e6), (2, 2)),
    "not square pixels": ((60, 90), (20.0, 20.0), (0.0, 1.0), (4, 6)),
    "full size": ((700, 900), (90.0, 70.0), (0.0, 1.0), (1, 1)),
}
LABEL = "difference of intensity / mean"


def plane(name):
    """Return a picture of random greys, and the greys as the colour table rounds them."""
    shape, half_width, (low, high), _ = PLANES[name]
    values = np.random.default_rng(1).integers(1, 255, shape)
    data = low + (high - low) * (values + 0.5) / 256
    png = plane_figure(data, half_width, "degrees", LABEL, "gray", (low, high))
    return png, plt.get_cmap("gray")(values, bytes=True)[..., 0]


@pytest.mark.every(2)
@pytest.mark.parametrize("name", PLANES)
def test_no_label_of_a_picture_is_cut_off(name, monkeypatch):
    monkeypatch.setattr(plt, "close", lambda figure: None)
    png, _ = plane(name)
    figure = plt.gcf()
    monkeypatch.undo()
    axes, scale = figure.axes
    labels = [axes.xaxis.label, axes.yaxis.label, scale.yaxis.label]
    boxes = [label.get_window_extent() for label in labels]
    assert [label.get_text() for label in labels] == ["x / degrees", "y / degrees", LABEL]
    plt.close(figure)
    seen = pixels(png)
    rows, columns, _ = seen.shape
    for box in boxes:
        assert 0 <= box.x0 < box.x1 <= columns
        assert 0 <= box.y0 < box.y1 <= rows
    for side in (seen[:3], seen[-3:], seen[:, :3], seen[:, -3:]):
        assert (side == 255).all()


@pytest.mark.every(4)
@pytest.mark.parametrize("name", sorted(set(PLANES) - {"offset"}))  # whose data are rounded
def test_every_pixel_of_a_picture_takes_the_same_whole_number_of_pixels_in_the_figure(name):
    png, values = plane(name)
    across, down = PLANES[name][3]
    seen, wanted = pixels(png)[..., 0], np.repeat(np.repeat(values, down, axis=0), across, axis=1)
    rows, columns = wanted.shape
    corners = [(0, 0), (0, -1), (-1, 0), (-1, -1)]
    windows = np.lib.stride_tricks.sliding_window_view(seen, wanted.shape)
    spots = np.argwhere(np.all([windows[..., r, c] == wanted[r, c] for r, c in corners], axis=0))
    (spot,) = [(r, c) for r, c in spots if (windows[r, c] == wanted).all()]
    frame = seen[spot[0] - 1 : spot[0] + rows + 1, spot[1] - 1 : spot[1] + columns + 1].copy()
    frame[1:-1, 1:-1] = frame[0, 0]
    assert (frame == frame[0, 0]).all()


def test_a_large_picture_is_shown_by_the_means_of_blocks():
    rng = np.random.default_rng(2)
    data = np.kron(rng.integers(1, 255, (525, 600)), np.ones((2, 2))) + np.tile([[0.5, -0.5]], (1050, 600))
    assert block(data.shape) == 2
    assert block((1040, 300)) == 1
    whole = plane_figure(data / 256, (20.0, 17.5), "mm", "", "gray", (0.0, 1.0))
    halved = plane_figure(data[::2, ::2] / 256, (20.0, 17.5), "mm", "", "gray", (0.0, 1.0))
    assert np.abs(pixels(whole) - pixels(halved)).max() <= 1


def test_the_misfit_is_labelled_by_plain_numbers(tmp_path, monkeypatch):
    labels = []

    def noted(figure):
        figure.canvas.draw()
        labels.extend(text.get_text() for text in figure.axes[0].get_yticklabels(which="both"))
        return png_bytes(figure)

    _, lens = shaped(tmp_path)
    rows = [SimpleNamespace(evaluation=k, fit=0.2 / (k + 1), stage=k // 5) for k in range(10)]
    monkeypatch.setattr(figures, "png_bytes", noted)
    lens_figures(lens, rows, PLAN)
    assert {"0.02", "0.1", "0.2"} <= set(labels)


def test_the_jump_from_coarse_to_fine_pixels_is_marked_and_both_are_named(tmp_path, monkeypatch):
    """One line per stage, none across the jump, and a vertical line between the two."""
    drawn = []
    monkeypatch.setattr(figures, "png_bytes", lambda figure: drawn.append(figure) or b"")
    _, lens = shaped(tmp_path)
    rows = [SimpleNamespace(evaluation=k, fit=0.1 / k, stage=int(k > 4)) for k in range(1, 9)]
    lens_figures(lens, rows, PLAN)
    (axes,) = drawn[-1].axes
    first, second, border = axes.lines
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "level 3, 64 x 32 pixels",
        "finish, 256 x 128 pixels",
    ]
    np.testing.assert_array_equal(first.get_xdata(), [1, 2, 3, 4])
    np.testing.assert_array_equal(second.get_xdata(), [5, 6, 7, 8])
    assert list(border.get_xdata()) == [4.5, 4.5]
    for figure in drawn:
        plt.close(figure)


def test_a_picture_for_viewers_at_the_lens_is_drawn_as_they_see_it(tmp_path, backend):
    """x goes to the left: all but the numbers below is that of the mirror image, and the caption says so."""
    data = np.random.default_rng(1).uniform(0, 1, (40, 40))
    arguments = (100.0, 100.0), "mm", LABEL, "gray", (0.0, 1.0)
    seen, mirror = (
        pixels(p) for p in (plane_figure(data, *arguments, True), plane_figure(data[:, ::-1], *arguments))
    )
    assert (seen[:500] == mirror[:500]).all()
    captions = []
    for side in ("behind", "lens"):
        system = small_system(tmp_path, {"target.seen_from": side, "target.pixels": [8, 8]})
        found = measure(system, backend)
        figures = light_figures(system, found, {})
        captions.append([figures[name][0] for name in ("target", "irradiance")])
    assert not any("x goes to the left" in caption for caption in captions[0])
    assert all("x goes to the left" in caption for caption in captions[1])
