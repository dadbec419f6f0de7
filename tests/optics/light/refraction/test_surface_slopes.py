"""Snell's law by slopes of a surface."""

from __future__ import annotations

import numpy as np
import pytest

from optics.light.refraction.shaped_refraction import refracted, refracting_slopes


def unit(*v):
    return [np.asarray(a) / np.sqrt(sum(np.square(b) for b in v)) for a in v]


def directions(rng, spread):
    return unit(*rng.uniform(-spread, spread, (2, 500)), np.ones(500))


@pytest.mark.parametrize("index", [1.33, 1.5, 1.8])
def test_slopes_send_light_where_they_were_asked_to(index):
    """For any length of what is asked for, wherever a surface can."""
    rng = np.random.default_rng(3)
    along, leaving = directions(rng, 0.2), directions(rng, 0.3)
    slopes, gentle, refracts = refracting_slopes(index, along, [7.0 * d for d in leaving])
    found = refracted(index, along, slopes)
    assert gentle.mean() > 0.5
    assert refracts[gentle].all()
    np.testing.assert_allclose([d[gentle] for d in found], [d[gentle] for d in leaving], rtol=0, atol=1e-13)


def test_angles_keep_the_law_of_sines():
    """n sin i = sin t at a plane that is tilted by i, for light along z."""
    tilt = np.radians([0.0, 5.0, 20.0, 40.0])
    x, _, z = refracted(1.5, (0.0, 0.0, 1.0), (np.tan(tilt), 0.0 * tilt))
    out = np.arctan2(x, z) + tilt  # from the normal (-sin, 0, cos)
    np.testing.assert_allclose(np.sin(out), 1.5 * np.sin(tilt), rtol=0, atol=1e-14)


def test_light_leaves_along_a_surface_that_would_reflect_it():
    x, _, z = refracted(1.5, (0.0, 0.0, 1.0), (np.array(2.0), np.array(0.0)))
    assert x * 2.0 - z == pytest.approx(0.0, abs=1e-12)
