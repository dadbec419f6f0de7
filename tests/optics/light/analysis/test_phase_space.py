"""Phase space: etendue and basic radiance are conserved through any lens, bins hold the flux."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.light.analysis.phase_space import PhaseSpace, at_target, jacobian_determinants, source_points
from optics.scene.sources import point_rays
from tests.cases import examples
from tests.optics.cases import hollow_lens, rough, small_lens, small_space
from thbcad.lens import FreeformSurface, Lens

SOURCE_Z, TARGET_Z = -4.0, 60.0
EXTENT = (2.0, 2.0, 0.1, 0.1)
PLATE = Lens(FreeformSurface((10, 10)), FreeformSurface((10, 10)), 6.0, 1.5)
LENSES = {"plate": PLATE, "rough": small_lens(sag=rough(small_space())), "two sizes": hollow_lens(rough)}


def bundle(count, seed=0, reach=(2.0, 2.0, 0.3, 0.3)):
    return np.random.default_rng(seed).uniform(-1, 1, (4, count)) * np.array(reach)[:, None]


@pytest.mark.parametrize("name", LENSES)
def test_the_map_to_the_target_has_determinant_one(backend, name):
    """Liouville, at rays from near the axis; central differences are wrong by the square of the step."""
    found = jacobian_determinants(backend, LENSES[name], bundle(200), EXTENT, SOURCE_Z, TARGET_Z)
    assert np.isfinite(found).mean() > 0.9
    assert np.nanmedian(np.abs(found - 1)) < 1e-7
    assert np.nanmax(np.abs(found - 1)) < 1e-3


def test_rays_that_do_not_arrive_have_no_determinant(backend):
    points = np.array([[0.0, 50.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    found = jacobian_determinants(backend, PLATE, points, EXTENT, SOURCE_Z, TARGET_Z)
    assert np.isfinite(found).tolist() == [True, False]


@examples(20)
@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_a_plate_shifts_rays_and_keeps_their_directions(backend, x, y, p, q):
    found = at_target(backend, PLATE, np.array([[x], [y], [p], [q]]), SOURCE_Z, TARGET_Z)
    outside, inside = np.sqrt(1 - p * p - q * q), np.sqrt(1.5**2 - p * p - q * q)
    way = (TARGET_Z - SOURCE_Z - PLATE.thickness) / outside + PLATE.thickness / inside
    np.testing.assert_allclose(found.points[:, 0], [x + way * p, y + way * q, p, q], rtol=0, atol=1e-12)


def test_the_detector_holds_the_flux_per_etendue():
    """Points at the middles of the bins of a uniform source: the radiance is the flux over the etendue,
    exactly."""
    bins, extent = (4, 3, 5, 2), (2.0, 1.5, 0.4, 0.3)
    axes = [(2 * np.arange(n) + 1 - n) / n * e for n, e in zip(bins, extent)]
    points = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")])
    radiance = PhaseSpace(points, np.full(points.shape[1], 1 / points.shape[1])).radiance(bins, extent)
    assert radiance.shape == bins
    np.testing.assert_allclose(radiance, 1 / np.prod([2 * e for e in extent]), rtol=1e-13)


def test_light_beside_the_box_is_not_counted():
    points = np.array([[0.5, 3.0], [0.5, 0.0], [0.1, 0.0], [0.1, 0.0]])
    radiance = PhaseSpace(points, np.array([1.0, 1.0])).radiance((1, 1, 1, 1), (1.0, 1.0, 1.0, 1.0))
    assert radiance.sum() == 1 / 16


def test_basic_radiance_behind_a_plate_is_that_of_the_source_times_its_transmittance(backend):
    """Light of one radiance near the axis: bins in the middle hold L T, T by Fresnel at normal incidence
    (0.96^2)."""
    points = bundle(200_000, reach=(3.0, 3.0, 0.05, 0.05))
    radiance = 1.0 / (6.0 * 6.0 * 0.1 * 0.1)
    there = at_target(backend, PLATE, points, SOURCE_Z, 7.0, 1.0 / points.shape[1])
    found = there.radiance((1, 1, 1, 1), (1.0, 1.0, 0.02, 0.02))
    inside = 200_000 * (2 * 2 * 0.04 * 0.04) / (6.0 * 6.0 * 0.1 * 0.1)
    assert found.item() == pytest.approx(0.96**2 * radiance, rel=4 / np.sqrt(inside))


def test_source_points_are_those_of_the_rays():
    rays = point_rays(2.0, 1.0, 30.0, 0.0, (5, 4), (0.0, 0.0))
    points = source_points(rays)
    assert np.array_equal(points[:2], np.zeros((2, 20)))
    np.testing.assert_allclose(points[2] ** 2 + points[3] ** 2 + rays.direction[2] ** 2, 1, rtol=1e-15)
