"""Pictures of made lenses have their panels, and the scale of the error that they show."""

from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from optics.light.analysis import Measurement
from optics.reporting.figures import height_error_figure, made_light_figure
from optics.scene.receivers import Screen
from optics.tolerancing.metrology import by_datums, made_surface
from tests.optics.tolerancing.metrology.cases import freeform, ripple, scattered


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


def test_the_light_is_drawn_in_four_panels(built: SimpleNamespace) -> None:
    with Image.open(BytesIO(made_light_figure(built, Screen((20.0, 15.0), (32, 24))))) as picture:
        assert picture.width > 3 * picture.height


def test_the_error_is_drawn_in_two_colours(built: SimpleNamespace) -> None:
    with Image.open(BytesIO(height_error_figure(built))) as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    red, blue = pixels[..., 0] - pixels[..., 2] > 100, pixels[..., 2] - pixels[..., 0] > 80
    assert red.mean() > 0.05
    assert blue.mean() > 0.05
