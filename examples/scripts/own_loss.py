"""Shape a lens by an own loss, with scipy's L-BFGS-B.

    L(c) = ||sqrt(E + e) - sqrt(T + e)||^2 / ||sqrt(T + e)||^2

The square root weighs dim and bright parts of the light more alike, as the eye does.
"""

from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import optics

PROBLEM = Path(__file__).parents[1] / "tophat_circle.toml"
DARK = 0.04  # e, of the mean target irradiance: the slope of the root stays finite


def main(iterations: int = 60) -> dict[str, float]:
    system = optics.System(optics.load_problem(PROBLEM))
    space = system.space(level=2)
    model = system.model(space, window="cells")
    e = DARK * model.target.mean()
    wanted = np.sqrt(model.target + e)

    def loss(c: np.ndarray) -> tuple[float, np.ndarray]:
        irradiance, pull = model.vjp(c)
        root = np.sqrt(irradiance + e)
        slope = (1 - wanted / root) / np.sum(wanted**2)  # dL/dE
        return np.sum((root - wanted) ** 2) / np.sum(wanted**2), pull(slope)

    start = system.transport_start(space).coefficients
    found = minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxiter": iterations})
    return system.measure(system.lens(space, found.x)).metrics


if __name__ == "__main__":
    print(f"rel_l2 {main()['rel_l2']:.4f}")
