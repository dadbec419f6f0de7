"""Outliers alone and in clumps are left out, counted and listed; detail that the surface lacks is not."""

import numpy as np
import pytest

from tests.thbcad.fitting.cases import smooth, tensor
from thbcad.fitting.adaptive_fit import fit
from thbcad.fitting.fit_targets import held_out
from thbcad.fitting.least_squares_fit import Samples, least_squares, robust_weights
from thbcad.fitting.residual_statistics import neighbours
from thbcad.surfaces import THBSurface

SIGMA = 1e-3
COUNT = 5000
FINE = np.linspace(0, 1, 61)
GRID = np.linspace(0, 1, 41)


def planted(rng, u, v, size, share):
    """Return the numbers of samples in clumps of a size, none of which is among the nearest of another."""
    near = neighbours(u, v, 24)
    free, clumps = np.ones(len(u), dtype=bool), []
    for k in rng.permutation(len(u)):
        clump = np.r_[k, near[k, : size - 1]]
        if free[clump].all():
            clumps.append(clump)
            free[np.r_[clump, near[clump].ravel()]] = False
        if len(clumps) * size >= share * len(u):
            break
    return np.sort(np.concatenate(clumps))


def truth(surface):
    return abs(surface.grid(FINE, FINE) - smooth(FINE[:, None], FINE)).max()


def judged(seed):
    """Judge a random pattern: 0.1 to 3 % outliers, alone, in pairs or in clumps of five."""
    rng = np.random.default_rng(seed)
    u, v = rng.random((2, COUNT))
    clean = smooth(u, v) + SIGMA * rng.normal(size=COUNT)
    bad = planted(rng, u, v, size=(1, 2, 5)[seed % 3], share=10 ** rng.uniform(-3, np.log10(0.03)))
    values = clean.copy()
    values[bad] += rng.choice([-1, 1], len(bad)) if rng.random() < 0.5 else 1.0
    found = fit(tensor(3, 6), Samples(u, v, values), 6 * SIGMA, robust=True)
    assert found.outcome == "reached", seed
    assert set(bad) <= set(found.outliers), seed
    # of 5000 normal samples 0.014 lie beyond 4.685 standard deviations: two do in 1 of 10 000 patterns
    assert len(found.outliers) <= len(bad) + 1, seed
    known = ~held_out(COUNT)
    known[bad] = False
    assert truth(found.surface) <= 2 * truth(least_squares(tensor(3, 6), Samples(u, v, clean)[known])), seed


@pytest.mark.parametrize("seeds", [range(3), pytest.param(range(3, 100), marks=pytest.mark.slow)], ids=len)
def test_random_patterns_of_outliers_are_judged_right(seeds):
    for seed in seeds:
        judged(seed)


def test_two_neighbours_among_20000_samples_are_outliers():
    rng = np.random.default_rng(0)
    u, v = rng.uniform(size=(2, 20000))
    z = u * v + SIGMA * rng.normal(size=20000)
    z[::100] += 1
    found = fit(tensor(3, 8), Samples(u, v, z), 6 * SIGMA, robust=True)
    assert found.outcome == "reached"
    assert found.outliers.tolist() == list(range(0, 20000, 100))
    assert not found.outliers.flags.writeable
    assert found.rms == pytest.approx(SIGMA, rel=0.05)  # of 6600 samples held out, to 1 %
    assert "200 outliers" in repr(found)
    assert abs(found.surface.grid(FINE, FINE) - np.outer(FINE, FINE)).max() < 0.0033


@pytest.mark.parametrize("scale", [[1.0], [1.0, 0.5, -1.0]])
def test_outliers_on_steep_ground_lie_within_the_values_around_them(scale):
    """Over twelve neighbours the ground rises by 3, an outlier by 1; in three dimensions they share it."""
    rng = np.random.default_rng(0)
    u, v = rng.random((2, 3000))
    values = np.outer(40 * u + 20 * v**2, scale)
    bad = planted(rng, u, v, size=2, share=0.01)
    values[bad] += 1
    found = fit(tensor(3, 6), Samples(u, v, values), 1e-3, robust=True)
    assert (found.outcome, found.outliers.tolist()) == ("reached", bad.tolist())


def test_outliers_are_numbered_as_the_samples_were_given():
    samples = Samples.grid(GRID, GRID, smooth(GRID[:, None], GRID))
    values, weights = samples.values.copy(), np.ones(len(samples))
    weights[:400], values[[7, 900]] = 0, 5
    given = Samples(samples.u, samples.v, values, weights)
    assert fit(tensor(3, 6), given, 1e-2, smoothing=1e-9, robust=True).outliers.tolist() == [900]
    assert len(fit(tensor(3, 6), given, 1e-2, smoothing=1e-9, max_level=0).outliers) == 0


def test_one_of_ten_samples_is_an_outlier():
    u, v = np.random.default_rng(0).random((2, 10))
    values = u + v
    values[4] += 1
    flat = tensor(1, 1)
    plane = THBSurface(flat, np.array([0.0, 1.0, 1.0, 2.0]))
    assert np.flatnonzero(robust_weights(plane, Samples(u, v, values)) == 0).tolist() == [4]


def plateau(side):
    values = np.zeros((41, 41))
    values[10 : 10 + side, 10 : 10 + side] = 1
    return values


@pytest.mark.parametrize(("side", "outliers"), [(1, 1), (2, 4), (3, 9), (6, 0), (12, 0)])
def test_a_step_that_many_samples_show_is_detail(side, outliers):
    """A square that is higher than all around it: of at most 24 samples it is a clump."""
    samples = Samples.grid(GRID, GRID, plateau(side))
    flat = tensor(1, 1)
    weights = robust_weights(THBSurface(flat, np.zeros(flat.dim)), samples)
    assert np.count_nonzero(weights == 0) == outliers
    assert (weights[samples.values == 0] == 1).all()


def test_good_samples_that_a_wild_surface_misses_keep_their_weight():
    """They agree with those around them: it is the surface that is wrong."""
    samples = Samples.grid(GRID, GRID, np.add.outer(GRID, GRID))
    space = tensor(3, 40)
    wild = np.zeros(space.dim)
    wild[900] = 50
    plane = np.add.outer(space.kv_u.greville(), space.kv_v.greville()).ravel()
    surface = THBSurface(space, plane + wild)
    assert np.count_nonzero(abs(surface(samples.u, samples.v) - samples.values) > 0.5) == 6
    assert robust_weights(surface, samples).min() > 0
