"""The light of a point source through a plate, which has a closed form, around the kinks of its cells."""

from math import cos, radians

import numpy as np
import pytest

from optics.light.analysis import measure
from optics.scene.system import System
from tests.optics.cases import flat_problem
from tests.optics.light.analysis.cases import through_plate

INDEX, THICKNESS, BEFORE, BEHIND, HALF_ANGLE = 1.5, 6.0, 10.0, 60.0, 30.0
FINE = 5  # points in each direction of a pixel


def closed_form(radius):
    """Return the irradiance at distances from the axis of 1 W, whose intensity falls with the cosine.

    A ray at the angle a meets the target at r(a); E = I(a) T(a) sin(a) / (r dr/da).
    """
    a = np.linspace(1e-4, radians(HALF_ANGLE), 20001)
    inside = np.arcsin(np.sin(a) / INDEX)
    r = (BEFORE + BEHIND) * np.tan(a) + THICKNESS * np.tan(inside)
    slope = (BEFORE + BEHIND) / np.cos(a) ** 2 + THICKNESS / np.cos(inside) ** 3 * np.cos(a) / INDEX
    intensity = np.cos(a) / np.pi / (1 - cos(radians(HALF_ANGLE)) ** 2)
    return np.interp(radius, r, intensity * through_plate(a, INDEX) * np.sin(a) / (r * slope))


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("half_width", "pixels", "most"),
    [((15.0, 15.0), (21, 21), 1e-3), ((15.0, 5.0), (42, 14), 1e-3), ((2.0, 2.0), (21, 21), 0.05)],
    ids=["square", "oblong", "finer than cells"],
)
def test_a_plate_before_a_point_has_the_closed_form(backend, half_width, pixels, most):
    """A pixel of five cells errs most where they lie around the middle: its border is n >= 2 cells away, on
    which the triangles of a ring are 0.04 / n^2 lighter and darker than their mean, in each of 2 n cells.
    Where pixels are finer than cells it is the first ring: 4 %, and extrapolation makes 5 % of it.

    In the mean over the pixels it is a third or less of that.
    """
    source = {"kind": "point", "half_angle": HALF_ANGLE, "exponent": 1.0, "distance": BEFORE}
    lens = {"index": INDEX, "thickness": THICKNESS}
    target = {"distance": BEHIND, "half_width": half_width, "pixels": pixels, "lit": (0.5, 0.5)}
    system = System(flat_problem(source, target, lens))
    found = measure(system, backend)
    x, y = (h * ((2 * np.arange(FINE * n) + 1) / (FINE * n) - 1) for h, n in zip(half_width, pixels))
    expected = closed_form(np.hypot(x[None, :], y[:, None]))
    expected = expected.reshape(pixels[1], FINE, pixels[0], FINE).mean(axis=(1, 3)) * system.problem.flux
    error = found.irradiance / expected - 1
    assert abs(error).max() < most
    assert np.sqrt((error**2).mean()) < most / 3
    assert found.metrics["rel_l2_floor"] > np.sqrt((error**2).mean()) / 3
