"""Regions of uniform light: areas, edges, symmetry, orientation."""

import tracemalloc

import numpy as np
import pytest

from optics.scene.problem import load_problem
from optics.scene.receivers.regions import REGIONS, uniform_region
from optics.scene.system import OpticalSystem
from tests.optics.cases import SMALL, toml_text

AREAS = {"rectangle": 4.0, "ellipse": np.pi, "crescent": 2.0}  # of [-1, 1]^2


@pytest.mark.parametrize("shape", REGIONS)
@pytest.mark.parametrize("lit", [(0.75, 0.75), (1.0, 0.4), (0.313, 0.97)])
def test_coverage_adds_up_to_the_area(shape, lit):
    covered = uniform_region(shape, (120, 80), lit)
    assert covered.shape == (80, 120)
    assert covered.min() >= 0
    assert covered.max() <= 1
    area = covered.sum() * (2 / 120) * (2 / 80)
    assert area == pytest.approx(AREAS[shape] * lit[0] * lit[1], rel=5e-3)  # slices of 1/32 pixel


@pytest.mark.parametrize("shape", REGIONS)
def test_pixels_within_are_whole_and_those_beyond_are_dark(shape):
    pixels = (64, 48)
    covered = uniform_region(shape, pixels, (0.8, 0.7))
    s, t = ((np.arange(n) + 0.5) / n * 2 - 1 for n in pixels)
    s, t = np.meshgrid(s / 0.8, -t / 0.7)
    middle, half = REGIONS[shape](np.clip(s, -1, 1))
    inside = (abs(s) < 1) & (abs(t - middle) < half)
    edge = (covered > 0) & (covered < 1)
    assert (covered[inside & ~edge] == 1).all()
    assert (covered[~inside & ~edge] == 0).all()
    assert edge.mean() < 0.12


def test_a_rectangle_on_pixel_borders_is_exact():
    covered = uniform_region("rectangle", (8, 8), (0.5, 0.75))
    assert covered[1:7, 2:6].tolist() == np.ones((6, 4)).tolist()
    assert covered.sum() == 24


@pytest.mark.parametrize("shape", REGIONS)
def test_a_region_needs_memory_for_its_pixels_alone(shape):
    """All 32 slices of all columns would take 32 times as much: 4.3 GB for 4096 x 4096 pixels."""
    tracemalloc.start()
    light = uniform_region(shape, (512, 512), (0.75, 0.75))
    assert tracemalloc.get_traced_memory()[1] < 3 * light.nbytes
    tracemalloc.stop()


@pytest.mark.parametrize("shape", REGIONS)
@pytest.mark.parametrize("lit", [(1.0, 1.0), (0.8, 0.31), (0.02, 0.9), (0.9, 0.004)])
def test_every_pixel_has_the_mean_over_its_slices(shape, lit):
    """Pixel by pixel and slice by slice, without telling whole pixels from cut ones."""
    columns, rows = 21, 16
    expected = np.zeros((rows, columns))
    for column in range(columns):
        s = ((column + (np.arange(32) + 0.5) / 32) / columns * 2 - 1) / lit[0]
        s = s[abs(s) <= 1]
        middle, half = REGIONS[shape](s)
        for row in range(rows):
            top, bottom = 1 - 2 * row / rows, 1 - 2 * (row + 1) / rows
            covered = np.minimum(top, lit[1] * (middle + half)) - np.maximum(bottom, lit[1] * (middle - half))
            expected[row, column] = np.maximum(covered, 0).sum() * rows / 2 / 32
    np.testing.assert_allclose(uniform_region(shape, (columns, rows), lit), expected, atol=1e-13)


def test_the_crescent_bends_downward():
    """Row 0 is at +y: the middle of the band lies above its ends."""
    covered = uniform_region("crescent", (60, 60), (1.0, 1.0))
    rows = np.arange(60)[:, None]
    centre = (covered * rows).sum(axis=0) / covered.sum(axis=0)
    assert centre[30] < centre[0]
    assert np.allclose(covered, covered[:, ::-1], atol=1e-12)


def test_a_top_hat_needs_no_picture(tmp_path):
    values = {k: v for k, v in SMALL.items() if k != "target.image"}
    path = tmp_path / "p.toml"
    path.write_text(
        toml_text(values | {"target.kind": "tophat", "target.shape": "ellipse", "target.lit": [0.5, 0.5]})
    )
    problem = load_problem(path)
    light = OpticalSystem(problem).target.light
    assert light.shape == problem.target.pixels[::-1]
    assert light.mean() == pytest.approx(np.pi / 16, rel=1e-2)
