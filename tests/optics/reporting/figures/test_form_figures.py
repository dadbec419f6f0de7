"""Pictures of form errors: of the allowed height by period, and of both sides of the lens."""

import numpy as np
import pytest
from PIL import Image

from optics.reporting.figures import form_figures_of
from optics.tolerancing.form_errors import BandCost, FormErrors, SideCost


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
