"""Fits to noisy samples: the noise is estimated, waves above it are kept, and what lies below it is not."""

import numpy as np
import pytest

from thbcad.fitting import Samples, fit_noisy
from thbcad.fitting.normal_equations import THIN_PLATE, thin_plate
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector

COUNT = 3000


def space(spans: int = 24) -> THBSpace:
    return THBSpace(*(KnotVector.uniform(3, spans, -10.0, 10.0) for _ in "uv"))


def wave(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.sin(2 * np.pi * u / 6) + 0.5 * np.cos(2 * np.pi * v / 9)


def samples(noise: float, height: float = 1.0, seed: int = 3) -> Samples:
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(-10, 10, (2, COUNT))
    return Samples(u, v, height * wave(u, v) + noise * rng.standard_normal(COUNT))


@pytest.mark.parametrize("noise", [0.01, 0.1, 1.0])
def test_the_noise_is_estimated_and_lowered(noise: float) -> None:
    fit = fit_noisy(space(), samples(noise))
    u, v = np.random.default_rng(0).uniform(-9, 9, (2, 2000))
    error = float(np.std(fit.surface(u, v) - wave(u, v)))
    assert fit.noise == pytest.approx(noise, rel=0.05)
    assert error < 0.6 * noise
    left = samples(noise).values - fit.surface(*_places(noise))
    assert np.allclose(fit.residuals, left, rtol=0, atol=1e-14)


def _places(noise: float) -> tuple[np.ndarray, np.ndarray]:
    return samples(noise).u, samples(noise).v


def test_more_noise_is_followed_by_fewer_degrees_of_freedom() -> None:
    freedoms = [fit_noisy(space(), samples(noise)).freedom for noise in (1e-3, 0.1, 10.0)]
    assert freedoms == sorted(freedoms, reverse=True)
    pure = fit_noisy(space(), samples(1.0, height=0.0))
    assert pure.freedom < 30
    assert float(np.std(pure.surface.grid(np.linspace(-9, 9, 30), np.linspace(-9, 9, 30)))) < 0.15


def test_the_fit_is_linear_in_the_values() -> None:
    one = samples(0.1)
    fit = fit_noisy(space(), one)
    both = fit.carried(np.column_stack([one.values, 2 * one.values - 1]))
    assert np.allclose(both[:, 0], fit.surface.coefficients, rtol=0, atol=1e-12)
    assert np.allclose(both[:, 1], 2 * fit.surface.coefficients - 1, rtol=0, atol=1e-9)


def test_redrawn_noise_spreads_as_fits_to_new_measurements_do() -> None:
    """The rms of carried noise is that of the fits of twenty measurements about their mean."""
    first = fit_noisy(space(), samples(0.3))
    rng = np.random.default_rng(1)
    carried = first.carried(first.noise * rng.standard_normal((COUNT, 20)))
    values = first.surface(*_places(0.3))[:, None] + 0.3 * rng.standard_normal((COUNT, 20))
    again = first.carried(values)
    assert np.std(carried) == pytest.approx(np.std(again - again.mean(axis=1, keepdims=True)), rel=0.1)


def test_a_space_that_is_finer_than_the_samples_is_bridged() -> None:
    few = samples(1e-3)[slice(0, 200)]
    fit = fit_noisy(space(32), few)
    assert np.abs(fit.surface.grid(np.linspace(-8, 8, 9), np.linspace(-8, 8, 9))).max() < 5


def test_the_energy_of_one_level_is_the_quadrature_over_its_cells() -> None:
    cells = THBSpace(KnotVector.uniform(3, 3, -1, 2), KnotVector.uniform(2, 4, 0, 1)).uniform(2)
    u, v, weights, _ = cells.quadrature()
    expected = np.zeros((cells.dim, cells.dim))
    for derivative, factor in THIN_PLATE:
        d = cells.collocation(u, v, derivative).toarray()
        expected += factor * d.T @ (weights[:, None] * d)
    assert np.abs(thin_plate(cells).toarray() - expected).max() < 1e-14 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (samples(1.0)[slice(0, 9)], "at least 16"),
        (Samples(*_places(1.0), np.zeros((COUNT, 2))), "scalar"),
        (Samples(*_places(1.0), np.zeros(COUNT), np.arange(COUNT) + 1.0), "equal weight"),
    ],
)
def test_other_samples_are_refused(bad: Samples, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        fit_noisy(space(), bad)
    with pytest.raises(ValueError, match="smoothing"):
        fit_noisy(space(), samples(1.0), smoothing=-1.0)
