"""Diverging beams: quantiles against quadrature of the laws, and directions that fill the cone evenly."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from optics.scene.sources import Divergence, Profile, area_parts

LAWS = {  # flux per angle, up to a factor, with a in radians
    "lambertian": lambda t, a: np.sin(t) * np.cos(t),
    "uniform": lambda t, a: np.sin(t),
    "theta_uniform": lambda t, a: 1.0,
    "gaussian": lambda t, a: t * np.exp(-((t / a) ** 2) / 2),
    "sun": lambda t, a: limb(t, a) * np.sin(t) * np.cos(t),
}


def limb(t, a):
    mu = np.sqrt(max(0.0, 1 - (np.sin(t) / np.sin(a)) ** 2))
    return 0.30 + 0.93 * mu - 0.23 * mu**2


@pytest.mark.parametrize("half_angle", [0.2665, 1.146, 14.0, 40.0])
@pytest.mark.parametrize("kind", LAWS)
def test_angles_are_the_quantiles_of_the_law(kind, half_angle):
    a = np.radians(half_angle)
    end = min(6 * a, np.radians(89)) if kind == "gaussian" else a
    whole = quad(LAWS[kind], 0, end, args=(a,))[0]
    u = np.array([1e-6, 0.1, 0.5, 0.9, 0.999])
    sines = Divergence(kind, half_angle).stretch(u) * np.sqrt(u)
    for fraction, sine in zip(u, sines):
        wanted = brentq(lambda t, f=fraction: quad(LAWS[kind], 0, t, args=(a,))[0] - f * whole, 0, end)
        assert np.arcsin(sine) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("kind", ["uniform", "gaussian", "sun", "lambertian"])
def test_the_radiance_on_the_axis(kind):
    """The flux within a small angle t is the radiance times pi sin^2 t."""
    spread = Divergence(kind, 5.0)
    u = np.array([1e-8])
    sine = spread.stretch(u) * np.sqrt(u)
    assert u / (np.pi * sine**2) == pytest.approx(spread.on_axis, rel=1e-4)


@pytest.mark.parametrize(
    ("kind", "half_angle"),
    [("uniform", 5.0), ("uniform", 60.0), ("gaussian", 20.0), ("gaussian", 35.0), ("lambertian", 60.0)],
)
def test_no_direction_has_more_radiance_than_the_greatest(kind, half_angle):
    """The radiance is the flux of a ring of angles over its projected solid angle."""
    a = np.radians(half_angle)
    end = min(6 * a, np.radians(89)) if kind == "gaussian" else a
    ends = np.linspace(0, end, 20_001)
    middles = (ends[1:] + ends[:-1]) / 2
    flux = np.array([LAWS[kind](t, a) for t in middles])
    radiance = flux / flux.sum() / (np.pi * np.diff(np.sin(ends) ** 2))
    spread = Divergence(kind, half_angle)
    assert radiance.max() == pytest.approx(spread.greatest, rel=5e-3)
    assert radiance.max() <= spread.greatest * (1 + 1e-4)


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("u", [1e-9, 0.3, 0.99])
def test_a_direction_is_a_unit_vector_at_its_quantile(kind, u):
    spread = Divergence(kind, 3.0)
    direction = spread.direction(u, 0.4)
    assert np.linalg.norm(direction) == pytest.approx(1, rel=1e-15)
    sine = float(spread.stretch(np.array(u)) * np.sqrt(u))
    np.testing.assert_allclose(direction[:2], [sine * np.cos(0.4), sine * np.sin(0.4)], rtol=1e-14)


def test_a_picture_of_the_sun_is_darker_at_its_limb():
    light = Divergence("sun", 0.2665).picture.light
    middle, limb_ = light[32, 32], light[32, 1]
    assert middle == pytest.approx(1.0, abs=1e-3)
    assert 0.3 < limb_ < 0.6
    assert light[0, 0] == 0
    assert light.mean() / light.max() == pytest.approx(0.805 * np.pi / 4, rel=0.01)


@pytest.mark.parametrize("kind", ["sun", "gaussian", "theta_uniform", "uniform"])
def test_rays_of_an_area_have_the_law_and_its_mirror_images(kind):
    (rays,) = area_parts((2.0, 3.0), 1.0, 1.0, Divergence(kind, 2.0), Profile(), 1 << 12, 0, 1 << 20)
    sine = np.hypot(*rays.direction[:2])
    u = (np.arange(1 << 12) + 0.5) / (1 << 12)
    wanted = Divergence(kind, 2.0).stretch(u) * np.sqrt(u)
    most = 4000  # of 4096: beyond, a Gaussian is thin
    np.testing.assert_allclose(np.sort(sine)[:most], wanted[:most], rtol=0, atol=0.02 * wanted[most])
    np.testing.assert_allclose(np.linalg.norm(rays.direction, axis=0), 1, rtol=1e-14)
    assert np.abs(rays.direction[:2].sum(axis=1)).max() < 1e-10
    assert rays.total == pytest.approx(1.0, rel=1e-14)
