"""Photometry of types A and B: directions by hand, flux by quadrature, and an intensity with a formula."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.scene.luminaires import Luminaire
from optics.scene.luminaires.goniometer_types import TYPE_A, TYPE_B, as_type_c

AXIS = np.array([0.25, 0.1, 1.0]) / np.linalg.norm([0.25, 0.1, 1.0])  # of the test light: up and to the right


def light(x, y, z):
    """Return the intensity of a smooth beam around an axis that lies beside +z, and is zero backwards."""
    return 1000 * np.maximum(AXIS[0] * x + AXIS[1] * y + AXIS[2] * z, 0.0) ** 8


def direction(kind, v, h):
    """Return d of V and H, degrees, by the definitions of LM-75."""
    v, h = np.radians(v), np.radians(h)
    if kind == TYPE_A:
        return np.sin(v), np.cos(v) * np.sin(h), np.cos(v) * np.cos(h)
    return np.cos(h) * np.sin(v), np.sin(h), np.cos(h) * np.cos(v)


def converted(kind, v, h, values=None):
    grid = np.meshgrid(v, h)  # (n, m)
    candela = light(*direction(kind, *grid)) if values is None else values
    return Luminaire(*as_type_c(kind, v, h, candela))


def flux_by_cells(kind, v, h, candela):
    """Return the flux of the bilinear intensity by the midpoint rule on 40 x 40 parts of every cell."""
    at = [np.interp(np.arange(40 * (len(a) - 1)) + 0.5, 40 * np.arange(len(a)), a) for a in (v, h)]
    steps = [np.radians(np.repeat(np.diff(a), 40) / 40) for a in (v, h)]
    rows = np.stack([np.interp(at[0], v, row) for row in candela])
    dense = np.stack([np.interp(at[1], h, column) for column in rows.T])  # (V, H)
    latitude = np.cos(np.radians(at[0]))[:, None] if kind == TYPE_A else np.cos(np.radians(at[1]))
    return (dense * latitude * np.outer(*steps)).sum()


@pytest.mark.parametrize("kind", [TYPE_A, TYPE_B])
def test_the_intensity_of_a_formula_is_met_within_the_square_of_the_step(kind):
    errors = []
    for step in (5.0, 2.5):
        angles = np.arange(-90, 90 + step, step)
        lamp = converted(kind, angles, angles)
        rng = np.random.default_rng(1)
        d = rng.normal(size=(3, 4000))
        d[2] = np.abs(d[2]) + 0.05
        d /= np.linalg.norm(d, axis=0)
        errors.append(np.abs(lamp.intensity(d) - light(*d)).max() / 1000)
    # I'' of cos^8 is at most 8 I per radian^2: h^2 / 8 of it in each of two directions of each of two grids
    assert errors[0] < 2 * 2 * 8 * np.radians(5.0) ** 2 / 8
    assert errors[1] < errors[0] / 3  # four, but for the steps of the other grid


@pytest.mark.parametrize("kind", [TYPE_A, TYPE_B])
def test_the_flux_of_uneven_angles_is_kept(kind):
    v = np.array([-90, -60, -35, -20, -8, 0, 4, 11, 25, 50, 90.0])
    h = np.array([-80, -50, -30, -12, -3, 2, 9, 22, 45, 75.0])
    candela = light(*direction(kind, *np.meshgrid(v, h)))
    assert converted(kind, v, h).flux == pytest.approx(flux_by_cells(kind, v, h, candela), rel=1e-4)


@pytest.mark.parametrize(
    ("kind", "v", "h", "c", "gamma"),
    [
        (TYPE_B, 30, 0, 0, 30),  # up is C = 0, along the length
        (TYPE_B, 0, 30, 270, 30),  # right, as seen from behind
        (TYPE_B, 30, 60, 286.10, 64.34),  # d = (0.25, 0.866, 0.433)
        (TYPE_A, 30, 0, 0, 30),
        (TYPE_A, 0, 30, 270, 30),
    ],
)
def test_a_spot_lies_where_its_direction_is(kind, v, h, c, gamma):
    angles = np.arange(-90, 91, 2.0)
    spot = np.exp(-((np.subtract.outer(angles, [h]) / 4) ** 2 + (angles - v) ** 2 / 16))
    lamp = converted(kind, angles, angles, spot)
    k, m = np.unravel_index(lamp.candela.argmax(), lamp.candela.shape)
    d = np.array(direction(kind, v, h))
    expected = np.degrees(np.arctan2(-d[1], d[0])) % 360, np.degrees(np.arccos(d[2]))
    assert (c, gamma) == pytest.approx(expected, abs=0.05)
    assert lamp.gammas[m] == pytest.approx(gamma, abs=1.1)
    assert abs((lamp.planes[k] - c + 180) % 360 - 180) < 2.1


@pytest.mark.parametrize("kind", [TYPE_A, TYPE_B])
def test_angles_from_0_on_are_mirrored(kind):
    whole = np.arange(-90, 91, 5.0)
    even = light(*np.abs(direction(kind, *np.meshgrid(whole, whole))))
    half = even[18:, 18:]
    np.testing.assert_array_equal(
        converted(kind, whole[18:], whole[18:], half).candela, converted(kind, whole, whole, even).candela
    )


def test_one_horizontal_angle_is_light_around_the_beam():
    planes, gammas, candela = as_type_c(
        TYPE_B, np.array([-40.0, 0, 40]), np.zeros(1), np.array([[1.0, 3, 1]])
    )
    np.testing.assert_array_equal((planes, gammas), ([0, 360], [0, 40]))
    np.testing.assert_array_equal(candela, [[3, 1], [3, 1]])
    with pytest.raises(UserError, match="one horizontal angle means light that is symmetric around the beam"):
        as_type_c(TYPE_B, np.array([-40.0, 0, 40]), np.zeros(1), np.array([[1.0, 3, 2]]))


@pytest.mark.parametrize("kind", [TYPE_A, TYPE_B])
def test_a_narrow_beam_keeps_its_peak(kind):
    angles = np.linspace(-10, 10, 201)  # steps of 0.1 degrees
    beam = 1000 * np.exp(-np.add.outer(angles**2, angles**2) / (2 * 0.3**2))
    lamp = converted(kind, angles, angles, beam)
    assert lamp.candela.max() == pytest.approx(1000, rel=5e-3)
    assert lamp.flux == pytest.approx(1000 * 2 * np.pi * np.radians(0.3) ** 2, rel=2e-3)  # of a Gaussian


def test_a_spot_finer_than_the_grid_is_refused_by_its_peak():
    angles = np.concatenate([np.linspace(-90, -2, 12), np.linspace(-1.99, 2, 400), np.linspace(10, 90, 9)])
    spot = np.zeros((len(angles), len(angles)))
    spot[12 + 253, 12 + 347] = 1000.0
    with pytest.raises(UserError, match=r"angles are as close as 0\.01 degrees over a cone of 90 degrees"):
        as_type_c(TYPE_B, angles, angles, spot)
    with pytest.raises(UserError, match="no light within 90 degrees"):
        as_type_c(TYPE_B, angles, angles, 0 * spot)
