"""Samples of diverging light: where they lie on the disk of directions, and how fine their borders are."""

import numpy as np
import pytest
from scipy.stats import kstest

from optics.light.analysis import light_of_beams
from optics.light.analysis.border_triangles import Borders
from optics.light.analysis.light_of_beams import SUNFLOWER, _disk_points, beam_irradiance
from tests.optics.light.analysis.cases import Made


def test_rings_of_different_sets_lie_anywhere():
    """Over many sets the share of the area within is even from 0 to 1: so sets differ by what each leaves."""
    rng = np.random.default_rng(5)
    within = np.array([_disk_points(1, rng)[:SUNFLOWER, 0, 0] for _ in range(400)])
    assert (np.floor(SUNFLOWER * within) == np.arange(SUNFLOWER)).all()  # one in each ring
    for ring, share in enumerate(within.T):
        assert kstest(SUNFLOWER * share - ring, "uniform").pvalue > 1e-3


def test_samples_are_turned_by_quarters():
    points = _disk_points(1, np.random.default_rng(6))[:, 0]
    of_quarters = points.reshape(4, SUNFLOWER, 2)
    assert (of_quarters[..., 0] == of_quarters[0, :, 0]).all()
    np.testing.assert_allclose(np.diff(of_quarters[..., 1], axis=0), np.pi / 2, rtol=0, atol=1e-14)


@pytest.mark.slow
def test_borders_of_beams_are_far_finer_than_their_samples_tell(tmp_path, backend, monkeypatch):
    """Light that comes in aslant misses the rear's rim; with borders four times finer the mean of all beams
    changes by less than a thirtieth of its error."""
    changes = {"source.divergence": 2.0, "source.half_width": [30.0, 30.0], "lens.outline": "ellipse"}
    made = Made(tmp_path, changes, backend)
    path = made.system.path
    light, fates = beam_irradiance(made.system, path, made.screen, backend)
    assert fates.missed_rear > 0.01 * fates.transmitted
    monkeypatch.setattr(light_of_beams, "BORDERS", Borders(4 * light_of_beams.BORDERS.cells, 12))
    finer, _ = beam_irradiance(made.system, path, made.screen, backend)
    off = np.linalg.norm(finer.irradiance - light.irradiance)
    assert 0 < off < np.linalg.norm(light.error) / 30
