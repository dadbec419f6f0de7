"""Small kernels and targets, and the exact optimum for them by an independent solver."""

import numpy as np
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from optics.designing.etendue.kernel import Kernel


@st.composite
def kernels(draw):
    """Kernels of all four kinds, of up to 7 x 7 taps."""
    kind = draw(st.sampled_from(["points", "rectangle", "disk", "image"]))
    if kind == "disk":
        return Kernel.disk(draw(st.floats(0.2, 3)))
    if kind == "rectangle":
        return Kernel.rectangle(draw(st.floats(0.2, 3)), draw(st.floats(0.2, 3)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    if kind == "image":
        return Kernel.image(rng.random(tuple(rng.integers(1, 7, 2))) + 0.01)
    count = draw(st.integers(1, 4))
    return Kernel.points(rng.integers(-3, 4, (count, 2)), rng.random(count) + 0.1)


@st.composite
def targets(draw, least=7, most=10):
    """Targets at least as large as these kernels, with dark pixels."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shape = tuple(rng.integers(least, most + 1, 2))
    target = rng.random(shape) * (rng.random(shape) < draw(st.floats(0.2, 1)))
    target[shape[0] // 2, shape[1] // 2] = 1
    return target


def matrix(kernel, shape):
    """Return the blur as a matrix, pixels of the image by pixels of light, tap by tap."""
    k, l = kernel.weights.shape
    out = np.zeros((*shape, shape[0] + k - 1, shape[1] + l - 1))
    for i in range(shape[0]):
        for j in range(shape[1]):
            out[i, j, i : i + k, j : j + l] = kernel.weights[::-1, ::-1]
    return out.reshape(shape[0] * shape[1], -1)


def optimum(a, target):
    """Return the least ||a f - g|| / ||g|| over f >= 0 (bounded-variable least squares)."""
    found = lsq_linear(a, target.ravel(), (0, np.inf), method="bvls", tol=1e-15, max_iter=10_000)
    return np.linalg.norm(a @ found.x - target.ravel()) / np.linalg.norm(target)
