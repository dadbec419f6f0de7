"""Pictures of form errors, of made lenses and of tools: their panels, and the scales that they show."""

from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from optics.light.analysis import Measurement
from optics.reporting.figures import figures_of_tool, form_figures_of, height_error_figure, made_light_figure
from optics.scene.receivers import Screen
from optics.tolerancing.form_errors import BandCost, FormErrors, SideCost
from optics.tolerancing.machining import ToolOrder, tool_findings
from optics.tolerancing.metrology import by_datums, made_surface
from tests.optics.cases import small_system
from tests.optics.reporting.cases import pixels
from tests.optics.tolerancing.machining.cases import bowl_lens
from tests.optics.tolerancing.metrology.cases import freeform, ripple, scattered


def cost(side, allowed):
    bands = tuple(
        BandCost(
            band=band,
            change_per_mm=1e3,
            by_formula=1e3,
            curvature_part=0.9,
            mtf=0.8,
            slope_cost=200.0,
            allowed_rms=rms,
            allowed_pv_sine=2.8 * rms,
            allowed_pv_field=8 * rms,
            traced_rel_l2=0.04,
        )
        for band, rms in zip([(1.0, 2.0), (2.0, 5.0)], allowed)
    )
    points = np.stack(np.meshgrid(np.linspace(-3, 3, 12), np.linspace(-2, 2, 9), indexing="ij"))
    return SideCost(side, bands, points, (np.ones((12, 9)), np.zeros((12, 9))))


@pytest.fixture(scope="module")
def figures():
    sides = cost("front", (1e-5, 3e-5)), cost("rear", (2e-5, 4e-5))
    return form_figures_of(FormErrors(0.03, 0.01, sides, 550.0, False))


def test_there_is_a_curve_and_a_map_of_each_side(figures):
    assert list(figures) == ["form_allowed", "form_map_front", "form_map_rear"]
    caption, _ = figures["form_allowed"]
    assert "a rise of rel_l2 by 0.01 from 0.0300" in caption


def test_the_pictures_are_drawn(figures, tmp_path):
    for name, (_, picture) in figures.items():
        (tmp_path / name).write_bytes(picture)
        with Image.open(tmp_path / name) as image:
            assert image.format == "PNG"
            assert len(np.unique(np.asarray(image))) > 20


@pytest.fixture(scope="module")
def built() -> SimpleNamespace:
    surface = freeform()
    x, y = scattered(2000)
    light = [np.random.default_rng(k).random((24, 32)) + 0.5 for k in range(3)]
    designed, made = (Measurement(image, light[2], {"rel_l2": 0.1}) for image in light[:2])
    return SimpleNamespace(
        made=made_surface(surface, by_datums(surface, np.stack([x, y, surface(x, y) + ripple(x, y)]))),
        nominal=designed,
        measurement=made,
        change=light[1] - light[0],
    )


@pytest.mark.slow
def test_the_light_is_drawn_in_four_panels(built: SimpleNamespace) -> None:
    with Image.open(BytesIO(made_light_figure(built, Screen((20.0, 15.0), (32, 24))))) as picture:
        assert picture.width > 3 * picture.height


def test_the_error_is_drawn_in_two_colours(built: SimpleNamespace) -> None:
    seen = pixels(height_error_figure(built))
    red, blue = seen[..., 0] - seen[..., 2] > 100, seen[..., 2] - seen[..., 0] > 80
    assert red.mean() > 0.05
    assert blue.mean() > 0.05


@pytest.mark.slow
def test_every_surface_that_is_cut_has_one_picture_with_a_panel_for_each_question(tmp_path, backend):
    system = small_system(tmp_path)
    order = ToolOrder(nose=1.0, feed=0.01)
    ((name, caption, png),) = figures_of_tool(
        tool_findings(system.with_lens(bowl_lens()), order, backend, rays=17)
    )
    assert name == "tool_rear.png"
    assert "acceleration" in caption
    assert png.startswith(b"\x89PNG")
    ((_, fewer, _),) = figures_of_tool(
        tool_findings(system.with_lens(bowl_lens()), ToolOrder(ball=50.0), backend, 17)
    )
    assert "acceleration" not in fewer
