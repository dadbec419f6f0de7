"""Polar and isocandela diagrams: the right curves on the right side, in the shown unit, nothing cut off."""

import numpy as np
import pytest
from matplotlib import pyplot as plt

from optics.reporting.figures import intensity_diagrams
from optics.reporting.figures.intensity_diagrams import FINEST, SHARES, intensity_figures
from optics.scene.photometry import units_of
from optics.scene.receivers import FarField, Screen
from tests.optics.reporting.cases import pixels

SCREEN = Screen((24.0, 12.0), (48, 30), receiver=FarField())
CANDELA = units_of("lm").in_far_field


def lobe(screen, u, v):
    """Return intensity with its peak of 1 at the angles u, v, degrees."""
    x, y = screen.centres
    return np.exp(-((x[None, :] - u) ** 2 + (y[:, None] - v) ** 2) / 18)


@pytest.fixture
def drawn(monkeypatch):
    """A function from a screen to the figures drawn of a lobe at (6, 3) degrees, and their captions.

    Twice as much is asked for, at the axis.
    """
    figures = []

    def made(screen):
        monkeypatch.setattr(intensity_diagrams, "png_bytes", lambda figure: figures.append(figure) or b"")
        named = intensity_figures(lobe(screen, 6, 3), 2 * lobe(screen, 0, 0), screen, CANDELA)
        return figures, [caption for caption, _ in named.values()]

    yield made
    for figure in figures:
        plt.close(figure)


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_polar_curves_are_those_of_the_two_planes(drawn):
    (figure, _), (caption, _) = drawn(SCREEN)
    (axes,) = figure.axes
    made, across, wanted, _ = axes.lines
    assert legend(figure) == ["C0-C180, made", "C90-C270, made", "C0-C180, asked for", "C90-C270, asked for"]
    assert figure.legends[0].get_title().get_text() == "intensity in cd"
    brightest = np.degrees(made.get_xdata()[np.argmax(made.get_ydata())])
    assert brightest == pytest.approx(6, abs=0.51)
    brightest = np.degrees(across.get_xdata()[np.argmax(across.get_ydata())])
    assert brightest == pytest.approx(-3, abs=0.51)  # C90 holds -y
    assert "C0 (towards its +x) and C90 (towards its -y)" in caption
    assert max(wanted.get_ydata()) == pytest.approx(2 * CANDELA.factor, rel=0.03)  # half a pixel beside it
    right, left = (axes.transData.transform([np.radians(a), 1.0])[0] for a in (20, -20))
    assert right > left  # C0 is on the right
    assert (axes.get_thetamin(), axes.get_thetamax()) == (-25, 25)
    assert "+-24 degrees in x and +-12 in y, not the whole sphere" in caption


def test_lines_of_equal_intensity_are_at_shares_of_the_peak(drawn):
    """Those of a Gaussian lobe at the share s are circles of radius sigma sqrt(2 ln(1 / s))."""
    (_, figure), (_, caption) = drawn(SCREEN)
    (axes,) = figure.axes
    wanted, light = axes.collections
    peak = CANDELA.factor * lobe(SCREEN, 6, 3).max()
    np.testing.assert_allclose(light.levels, np.array(SHARES) * peak)
    np.testing.assert_array_equal(wanted.levels, light.levels)
    for share, path in zip(SHARES, light.get_paths()):
        radius = np.hypot(*(path.vertices - [6, 3]).T)
        inside = np.abs(path.vertices[:, 1]) < 11.9
        np.testing.assert_allclose(radius[inside], 3 * np.sqrt(2 * np.log(1 / share)), atol=0.1)
    assert legend(figure) == [f"{s * peak:.4g} cd ({s:.0%} of the peak)" for s in SHARES]
    assert f"the peak is {peak:.4g} cd" in caption


def test_fine_pixels_are_merged_where_they_are(drawn):
    """Three pixels become one; the lines stay at their angles."""
    screen = Screen((24.0, 24.0), (2 * FINEST + 1, 2 * FINEST + 1), receiver=FarField())
    (_, figure), _ = drawn(screen)
    vertices = figure.axes[0].collections[1].get_paths()[2].vertices
    np.testing.assert_allclose((vertices.max(axis=0) + vertices.min(axis=0)) / 2, [6, 3], atol=0.02)


def test_light_that_does_not_arrive_is_drawn_without_lines():
    dark, wanted = np.zeros((30, 48)), lobe(SCREEN, 0, 0)
    assert [*intensity_figures(dark, wanted, SCREEN, CANDELA)] == ["polar", "isocandela"]


@pytest.mark.every(3)
@pytest.mark.parametrize("half_width", [(1.5, 1.0), (15.0, 15.0), (40.0, 80.0), (89.0, 89.0)])
def test_nothing_is_cut_off(half_width):
    screen = Screen(half_width, (40, 40), receiver=FarField())
    light = 1e3 * np.ones((40, 40)) - np.indices((40, 40)).sum(axis=0)
    for _, png in intensity_figures(light, light, screen, CANDELA).values():
        seen = pixels(png)
        for side in (seen[0], seen[-1], seen[:, 0], seen[:, -1]):
            assert (side == 255).all()
    assert not plt.get_fignums()
