"""Networks whose outputs are heights of control points: layers, gradients, starts, and a short training."""

from importlib import import_module

import numpy as np
import pytest

from examples.thesis import networks
from optics.base.runtime import load_backend

SHAPE, REACH = (5, 4), (2, 1)

dr = load_backend("double").dr  # of a version of LLVM that works; the scripts below load Dr.Jit by themselves
Float, Tensor = dr.llvm.ad.Float64, dr.llvm.ad.TensorXf64
layers = import_module("examples.thesis.sparse_layers")
heights = import_module("examples.thesis.height_network")


def filled(layer, seed):
    """Return random weights and bias of a layer, which it has now."""
    random = np.random.default_rng(seed)
    weights, bias = random.standard_normal(layer.weights.shape), random.standard_normal(layer.bias.shape)
    layer.weights, layer.bias = Tensor(weights), Tensor(bias)
    return weights, bias


def dense(weights):
    """Return the matrix of a sparse layer, by loops over pairs of neurons."""
    (columns, rows), (p, q) = SHAPE, REACH
    matrix = np.zeros((columns * rows, columns * rows))
    for i, j in np.ndindex(columns, rows):
        for k, l in np.ndindex(columns, rows):
            if abs(i - k) <= p and abs(j - l) <= q:
                tap = (k - i + p) * (2 * q + 1) + l - j + q
                matrix[i * rows + j, k * rows + l] = weights[i * rows + j, tap]
    return matrix


@pytest.fixture
def layer():
    return layers.SparseLinear(SHAPE, REACH)._alloc(Tensor, 20, None)[0]


def test_a_sparse_layer_is_a_matrix_with_zeros(layer):
    weights, bias = filled(layer, 1)
    x = np.random.default_rng(2).standard_normal((20, 1))
    wanted = dense(weights) @ x + bias[:, None]
    np.testing.assert_allclose(layer(Tensor(x)).numpy(), wanted, rtol=0, atol=1e-14)


def test_its_derivatives_are_those_of_the_matrix(layer):
    weights, _ = filled(layer, 3)
    random = np.random.default_rng(4)
    x, bar = Tensor(random.standard_normal((20, 1))), random.standard_normal(20)
    dr.enable_grad(x, layer.weights)
    dr.backward(dr.sum(layer(x).array * Float(bar)))
    np.testing.assert_allclose(dr.grad(x).numpy()[:, 0], dense(weights).T @ bar, rtol=0, atol=1e-13)
    near, exist = layers.neighbours(SHAPE, REACH)
    wanted = np.where(exist, bar[:, None] * x.numpy()[near, 0], 0.0)
    np.testing.assert_allclose(dr.grad(layer.weights).numpy(), wanted, rtol=0, atol=1e-14)


def test_neurons_have_the_neighbours_that_share_a_span():
    """p + 1 in each direction at a corner, 2p + 1 in the middle."""
    _, exist = layers.neighbours((9, 9), (3, 3))
    counts = exist.sum(axis=1).reshape(9, 9)
    assert counts[0, 0] == 16
    assert counts[4, 4] == 49


@pytest.mark.parametrize(("kind", "parameters"), [("dense", 2 * 36**2 + 144), ("sparse", 2 * 24**2 + 144)])
def test_a_network_has_the_gradient_of_its_outputs(kind, parameters):
    """In the sparse one 3, 4, 5, 5, 4, 3 neurons in a row are near: 24^2 connections."""
    network = heights.Network(kind, 6, 2)
    theta = network.start(seed=5, ordinary=True)
    random = np.random.default_rng(6)
    bar, direction = random.standard_normal(36), random.standard_normal(len(theta))
    along = network(theta)[1](bar) @ direction
    ahead, back = (bar @ network(theta + s * 1e-5 * direction)[0] for s in (1, -1))
    assert along == pytest.approx((ahead - back) / 2e-5, rel=1e-7)
    assert network.parameters == parameters


def test_the_starts_are_as_small_as_the_thesis_says():
    network = heights.Network("sparse", 6, 2)
    assert 0.9 * heights.SMALL < np.abs(network.start(seed=7)).max() <= heights.SMALL
    first, hidden = np.split(np.abs(network.start(seed=7, ordinary=True)), [72])
    assert 0.9 < first.max() <= 1
    assert 0.19 < hidden.max() <= 1 / 5  # of 25 neighbours
    assert np.abs(network(network.start(seed=7))[0]).max() < 2 * heights.SMALL


@pytest.mark.slow
def test_a_few_steps_of_the_script_better_the_flat_lens():
    assert networks.main("sparse", 1e-3, 12)["rel_l2"] < networks.main("sparse", 1e-3, 0)["rel_l2"] - 0.01
