"""The lower bound of rel_l2 for light made of images of the source, and the stack of kernels that it is made
with."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import nnls

from optics.designing.etendue.approximation import approximate
from optics.designing.etendue.kernel import Kernel
from optics.designing.etendue.kernel_stack import KernelStack, stack_approximation
from optics.designing.etendue.source_image_bound import any_proportions, image_bound
from optics.scene.sources import Profile
from tests.cases import examples

SIDES = st.integers(1, 4)
SEEDS = st.integers(0, 2**32 - 1)


def matrix(stack, shape):
    """Return A of a stack, (n m, lights), column by column, without the rounding of the transforms where it
    is 0."""
    lights = stack.light_shape(shape)
    found = np.stack([stack.apply(e.reshape(lights)).ravel() for e in np.eye(np.prod(lights))], axis=1)
    return np.where(found > 1e-12, found, 0.0)


def covered(start, side, n):
    """Return the shares of n pixels that the interval [start, start + side] covers, over side."""
    edges = np.clip(np.arange(n + 1), start, start + side)
    return np.diff(edges) / side


def rectangle(rng, size, shape):
    """Return a uniform rectangle of height and width `size`, anywhere on or across an image of the given
    shape."""
    at = [rng.uniform(-side, n) for side, n in zip(size, shape)]
    return np.outer(*(covered(a, side, n) for a, side, n in zip(at, size, shape)))


def nearest(light, target):
    """Return the least ||c E - G|| / ||G|| over c >= 0."""
    size = np.vdot(light, light)
    scale = max(0.0, np.vdot(light, target) / size) if size else 0.0
    return np.linalg.norm(scale * light - target) / np.linalg.norm(target)


@examples(20)
@given(SIDES, SIDES, SEEDS)
def test_adjoint_and_reach_belong_to_the_stack(rows, columns, seed):
    rng, shape = np.random.default_rng(seed), (7, 9)
    stack = KernelStack.boxes(rows, columns)
    light, image = rng.normal(size=stack.light_shape(shape)), rng.normal(size=shape)
    assert np.vdot(stack.apply(light), image) == pytest.approx(
        np.vdot(light, stack.adjoint(image)), abs=1e-12 * light.size
    )
    np.testing.assert_allclose(stack.adjoint(np.ones(shape)), stack.column_sums(shape), atol=1e-14)
    np.testing.assert_allclose(stack.apply(np.ones(stack.light_shape(shape))), 1, atol=1e-13)


def test_a_stack_is_the_mean_of_its_kernels():
    rng, shape = np.random.default_rng(3), (6, 8)
    stack = KernelStack.boxes(2, 3)
    lights = rng.uniform(size=stack.light_shape(shape))
    parts = lights.reshape(4, -1, lights.shape[1])
    expected = sum(kernel.apply(part) for kernel, part in zip(stack.kernels, parts)) / 4
    np.testing.assert_allclose(stack.apply(lights), expected, atol=1e-14)


@examples(8)
@given(SIDES, SIDES, st.floats(0, 1), st.floats(0, 1), SEEDS)
def test_every_rectangle_between_is_a_sum_of_boxes(rows, columns, more, wider, seed):
    """The lemma that carries the bound: sides k to k + 1, anywhere on the pixels."""
    shape = (5, 6)
    light = rectangle(np.random.default_rng(seed), (rows + more, columns + wider), shape)
    _, error = nnls(matrix(KernelStack.boxes(rows, columns), shape), light.ravel())
    assert error <= 1e-10


@examples(8)
@given(SEEDS)
def test_the_bound_is_below_the_optimum_and_near_it(seed):
    target = np.random.default_rng(seed).uniform(size=(7, 8)) ** 3
    stack = KernelStack.boxes(2, 2)
    _, optimum = nnls(matrix(stack, target.shape), target.ravel())
    optimum /= np.linalg.norm(target)
    found, bound = stack_approximation(stack, target, 1e-6, 20000)
    assert bound <= optimum * (1 + 1e-12)
    assert found.residual >= optimum * (1 - 1e-12)
    assert bound >= 0.99 * found.residual


@examples(8)
@given(st.floats(2.0, 5.0), st.floats(2.0, 5.0), st.floats(1.0, 3.0), st.integers(1, 2), SEEDS)
def test_no_light_made_of_images_is_nearer(high, wide, larger, merge, seed):
    """Images of one size c w, c >= 1, in any number and anywhere, against any target."""
    rng, shape = np.random.default_rng(seed), (13, 14)
    target = (rng.uniform(size=shape) > 0.6) + 0.01
    bound = image_bound(target, (wide, high), Profile(), merge, 1e-4)
    light = sum(rng.exponential() * rectangle(rng, (larger * high, larger * wide), shape) for _ in range(20))
    assert bound.lower_bound <= nearest(light, target) + 1e-12
    assert bound.lower_bound <= bound.attained


@pytest.mark.slow
@examples(8)
@given(st.floats(2.0, 4.0), st.floats(1.0, 3.0), SEEDS)
def test_light_of_images_is_not_excluded(wide, larger, seed):
    """A target that is itself such light has the bound 0 up to the solver's residual: the test that catches a
    bound too high."""
    rng, shape = np.random.default_rng(seed), (16, 16)
    target = sum(rng.exponential() * rectangle(rng, (larger * wide, larger * wide), shape) for _ in range(30))
    assert image_bound(target, (wide, wide), Profile(), 1, 1e-5).lower_bound <= 1e-9


@examples(4)
@given(st.floats(4.0, 20.0), st.floats(-2.0, 2.0), st.floats(1.0, 3.0), st.integers(1, 2), SEEDS)
def test_no_light_of_images_in_any_proportions_is_nearer(area, stretch, larger, merge, seed):
    """Images of one size, at least the area, in any number and anywhere, against any target."""
    rng, shape = np.random.default_rng(seed), (13, 14)
    target = (rng.uniform(size=shape) > 0.6) + 0.01
    bound = any_proportions(target, area, merge, 1e-3, 12)
    side = np.sqrt(larger * area)
    size = side * np.exp(stretch), side * np.exp(-stretch)
    light = sum(rng.exponential() * rectangle(rng, size, shape) for _ in range(20))
    assert bound.lower_bound <= nearest(light, target) + 1e-12
    assert bound.lower_bound <= bound.attained + 1e-12


@examples(2)
@given(st.floats(6.0, 9.0), st.floats(-1.2, 1.2), SEEDS)
def test_light_of_stretched_images_is_not_excluded(area, stretch, seed):
    """A target that is itself such light has the bound 0 up to the solver's residual."""
    rng, shape = np.random.default_rng(seed), (16, 16)
    size = np.sqrt(area) * np.exp(stretch), np.sqrt(area) * np.exp(-stretch)
    target = sum(rng.exponential() * rectangle(rng, size, shape) for _ in range(30))
    assert any_proportions(target, area, 1, 1e-4).lower_bound <= 1e-9


@pytest.mark.slow
def test_the_search_over_proportions_stays_below_all_that_are_tried():
    """A chequerboard, whose contrast boxes of 12 square pixels lose: each of six sizes by itself is no
    better."""
    target = (np.indices((15, 15)).sum(axis=0) % 2) + 0.05
    found = any_proportions(target, 12.0, 1, 1e-5)
    tried = [approximate(Kernel.rectangle(h / 2, 6 / h), target).residual for h in (1, 2, 3, 4, 6, 12)]
    assert 0.1 < found.lower_bound <= min(tried)
    assert found.lower_bound >= 0.95 * found.attained


def test_a_fine_pattern_is_excluded():
    """No box is narrower than two stripes of one pixel: contrast is lost, but for merged pixels there is
    none."""
    stripes = np.zeros((24, 24))
    stripes[:, ::2] = 1.0
    bound = image_bound(stripes, (2.0, 2.0), Profile(), 1, 1e-6)
    assert 0.3 < bound.lower_bound <= bound.attained < 1.01 * bound.lower_bound
    assert image_bound(stripes, (2.0, 2.0), Profile(), 2).lower_bound == 0


@pytest.mark.parametrize("width", [(1.99, 1.99), (0.01, 0.5)])
def test_images_of_single_pixels_set_no_limit(width):
    bound = image_bound(np.eye(8), width, Profile())
    assert (bound.lower_bound, bound.attained, bound.sizes) == (0, 0, 0)


def test_images_larger_than_the_target():
    """Seen from within, they are edges and even light."""
    bound = image_bound(np.eye(12) + 0.1, (500.0, 30.0), Profile(), 1, 1e-4)
    assert 0.5 < bound.lower_bound <= bound.attained


def test_rows_beside_the_merged_pixels_are_left_out():
    target = np.zeros((9, 9))
    target[8, 8] = 1
    assert image_bound(target, (4.0, 4.0), Profile(), 2).lower_bound == 0


def test_pictures_of_other_sources():
    target = np.pad(np.ones((10, 10)), 10)
    light = np.zeros((2, 2))
    light[0, 1] = 1.0  # bright at -y of the array's row 0, which is +y, and +x
    corner = image_bound(target, (6.0, 6.0), Profile("image", light=light)).kernel
    assert corner[: len(corner) // 2].sum() < corner[len(corner) // 2 + 1 :].sum()  # turned by 180 degrees
    assert corner[:, : len(corner) // 2].sum() > corner[:, len(corner) // 2 + 1 :].sum()
    disk = image_bound(target, (6.0, 6.0), Profile("round"))
    np.testing.assert_allclose(disk.kernel, Kernel.disk(3.0).weights, atol=1e-3)
    assert 0 < disk.lower_bound <= disk.attained
    assert image_bound(target, (6.0, 6.0), Profile("gaussian", (0.3, 0.3))).lower_bound < disk.lower_bound


def test_a_stack_of_different_shapes_is_refused():
    with pytest.raises(ValueError, match="one shape"):
        KernelStack((Kernel(np.ones((3, 3))), Kernel(np.ones((3, 5)))))
    with pytest.raises(ValueError, match="one shape"):
        KernelStack(())
