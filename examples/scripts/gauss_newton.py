"""Shape a lens by least squares: Gauss-Newton steps J d = T - E(c), each solved by LSMR without a matrix.

J is the derivative of the irradiance: `jvp` multiplies by it, the pull of `vjp` by its transpose.
"""

from pathlib import Path

import numpy as np
from scipy.sparse.linalg import LinearOperator, lsmr

import optics

PROBLEM = Path(__file__).parents[1] / "tophat_circle.toml"
DAMPING = 0.01  # 1/mm, of a step: it holds back changes of the sag that hardly move light


def better(model: optics.Model, c: np.ndarray, iterations: int) -> np.ndarray:
    """Return the coefficients after a step."""
    scale, (irradiance, pull) = np.linalg.norm(model.target), model.vjp(c)
    residual = (model.target - irradiance).ravel() / scale
    print(f"||E - T|| / ||T|| = {np.linalg.norm(residual):.5f}")
    jacobian = LinearOperator(
        (residual.size, len(c)),
        matvec=lambda d: model.jvp(c, d)[1].ravel() / scale,
        rmatvec=lambda w: pull(w.reshape(model.shape) / scale),
    )
    return c + lsmr(jacobian, residual, damp=DAMPING, maxiter=iterations)[0]


def main(steps: int = 4) -> dict[str, float]:
    system = optics.System(optics.load_problem(PROBLEM))
    space = system.space(level=2)
    model, c = system.model(space, (257, 257), "cells"), system.transport_start(space).coefficients
    for _ in range(steps):
        c = better(model, c, 20)
    return system.measure(system.lens(space, c)).metrics


if __name__ == "__main__":
    print(f"rel_l2 {main()['rel_l2']:.4f}")
