"""Regularised deblurring to compare with: maximum entropy, conjugate gradients, and these with a Laplacian.

As in the thesis, light is where the image is: F has the target's shape, and A is the kernel's blur of F with
zeros around.

Source: thesis 7.4.1; P. C. Hansen, Numer. Algorithms 46 (2007), Regularization Tools: maxent, cgls, pcgls.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft
from scipy.optimize import minimize
from scipy.sparse.linalg import LinearOperator, lsqr

from optics.designing.etendue import Kernel, Real, require_target
from thbcad.checks import Floats, require_integer, require_number

MOST_STEPS = 200
STOP = 1e-8  # of the dual's gradient, relative to the target: what the image misses


Map: TypeAlias = Callable[[Real], Real]


def maximum_entropy(kernel: Kernel, target: ArrayLike, mu: float) -> Real:
    """Return the light F > 0 that minimises ||A F - G||^2 + mu^2 sum of F log F.

    By its dual, the concave, unconstrained problem  max over y of <y, G> - ||y||^2 / 4 - mu^2 sum of F(y),
    F(y) = exp(A^T y / mu^2 - 1), whose Hessian -1/2 - A diag(F) A^T / mu^2 is bounded from 0: Newton steps by
    conjugate gradients.  At the optimum y = 2 (G - A F).  The entropy depends on the unit of the target.
    """
    goal = require_target(kernel, target)
    require_number("mu", mu, above=0.0)
    blur, back = _maps(kernel, goal.shape)

    def light(y: Floats) -> Real:
        return np.exp(back(y) / mu**2 - 1)

    def dual(y: Floats) -> tuple[float, Floats]:
        f = light(y)
        return mu**2 * f.sum() + y @ y / 4 - y @ goal.ravel(), blur(f).ravel() - goal.ravel() + y / 2

    def curvature(y: Floats, p: Floats) -> Real:
        return blur(light(y) * back(p)).ravel() / mu**2 + p / 2

    options = {"gtol": STOP * float(np.linalg.norm(goal)), "maxiter": MOST_STEPS}
    start = np.zeros(goal.size)
    solved = minimize(dual, start, jac=True, hessp=curvature, method="trust-krylov", options=options)
    return light(solved.x)


def conjugate_gradients(kernel: Kernel, target: ArrayLike, steps: int) -> Real:
    """Return the light after steps of CGLS from 0 on min ||A F - G||.  LSQR has the same iterates."""
    goal = require_target(kernel, target)
    return _lsqr(kernel, goal, steps, lambda f: f)


def laplacian_gradients(kernel: Kernel, target: ArrayLike, steps: int) -> Real:
    """Return the light F = L^-1 y after steps of CGLS from 0 on min ||A L^-1 y - G|| (PCGLS).

    L is the five-point Laplacian, F odd about the edges of the image; the sine transform makes it diagonal.
    """
    goal = require_target(kernel, target)
    values = [2 - 2 * np.cos(np.pi * np.arange(1, side + 1) / side) for side in goal.shape]
    inverse = 1 / np.add.outer(*values)
    return _lsqr(kernel, goal, steps, lambda y: fft.idstn(fft.dstn(y) * inverse))


def _lsqr(kernel: Kernel, goal: Floats, steps: int, smoothed: Map) -> Real:
    """Return S y after steps on min ||A S y - G||, S symmetric."""
    require_integer("steps", steps, 1)
    blur, back = _maps(kernel, goal.shape)
    operator = LinearOperator(
        (goal.size, goal.size),
        matvec=lambda y: blur(smoothed(y.reshape(goal.shape))).ravel(),
        rmatvec=lambda image: smoothed(back(image)).ravel(),
        dtype=np.float64,
    )
    y = lsqr(operator, goal.ravel(), atol=0, btol=0, conlim=0, iter_lim=steps)[0]
    return smoothed(y.reshape(goal.shape))


def _maps(kernel: Kernel, shape: tuple[int, ...]) -> tuple[Map, Map]:
    """Return the blur of light above the image, (n, m) to (n, m), and its adjoint, n m values to (n, m)."""
    (i, j), (n, m) = (taps // 2 for taps in kernel.weights.shape), shape

    def blur(light: Real) -> Real:
        return kernel.apply(np.pad(light, ((i, i), (j, j))))

    def back(image: Real) -> Real:
        return kernel.adjoint(image.reshape(shape))[i : i + n, j : j + m]

    return blur, back
