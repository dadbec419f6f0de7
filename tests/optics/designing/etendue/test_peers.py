"""The same problems solved by pylops and pyproximal, where they are installed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from examples.thesis.chapter7.regularisation import conjugate_gradients
from optics.designing.etendue.approximation import approximate
from optics.designing.etendue.kernel import Kernel
from tests.optics.designing.etendue.cases import matrix

X = np.linspace(-1, 1, 40)
TARGET = (np.hypot(X[:, None], X) < 0.6).astype(float)
KERNEL = Kernel.rectangle(2.0, 1.5)


def test_pylops_has_the_same_conjugate_gradients():
    pylops = pytest.importorskip("pylops")
    blur = pylops.signalprocessing.Convolve2D(
        TARGET.shape, KERNEL.weights, offset=tuple(side // 2 for side in KERNEL.weights.shape)
    )
    for steps in (1, 5, 20):
        other = pylops.cgls(blur, TARGET.ravel(), x0=np.zeros(TARGET.size), niter=steps, tol=0)[0].reshape(
            TARGET.shape
        )
        assert_allclose(conjugate_gradients(KERNEL, TARGET, steps), other, atol=1e-8)


def test_pyproximal_comes_between_the_bound_and_nothing_better():
    """Its accelerated proximal gradient descends to our residual from above, and never below our bound."""
    pylops, pyproximal = pytest.importorskip("pylops"), pytest.importorskip("pyproximal")
    blur = pylops.MatrixMult(matrix(KERNEL, TARGET.shape))
    own = approximate(KERNEL, TARGET, 1e-6)
    residuals = []
    for steps in (30, 300):
        light = pyproximal.optimization.primal.ProximalGradient(
            pyproximal.L2(Op=blur, b=TARGET.ravel()),
            pyproximal.Box(lower=0),
            np.zeros(blur.shape[1]),
            tau=1.0,
            niter=steps,
            acceleration="fista",
        )
        residuals.append(np.linalg.norm(blur @ light - TARGET.ravel()) / np.linalg.norm(TARGET))
    assert own.lower_bound <= residuals[1] <= residuals[0]
    assert own.residual <= residuals[1] <= 1.01 * own.residual
