"""Shape a lens by a network: Adam changes its weights and biases, its outputs are heights of control points.

    z = z_freedom network(theta),    L(theta) = ||E(z) - T|| / ||T||        (thesis 5.4, 5.5)

Run in the checkout: python -m examples.thesis.networks
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

import optics

PROBLEM = Path(__file__).with_name("networks.toml")
Pull = Callable[[np.ndarray], np.ndarray]
Heights = Callable[[np.ndarray], tuple[np.ndarray, Pull]]  # theta -> z / z_freedom, and dL/dz -> dL/d(theta)


def loss_through(
    heights: Heights, model: optics.Model, wanted: np.ndarray, bound: float
) -> Callable[[np.ndarray], tuple[float, np.ndarray]]:
    """Return L with its gradient as a function of theta.  wanted : T, W/mm^2.  bound : z_freedom, mm."""

    def loss(theta: np.ndarray) -> tuple[float, np.ndarray]:
        z, pull = heights(theta)
        irradiance, down = model.vjp(bound * z)
        difference, scale = irradiance - wanted, np.linalg.norm(wanted)
        misfit = np.linalg.norm(difference)
        return float(misfit / scale), pull(bound * down(difference / (misfit * scale)))

    return loss


def main(kind: str = "dense", step: float = 1e-3, iterations: int = 300) -> dict[str, float]:
    system = optics.System(optics.load_problem(PROBLEM))
    from examples.thesis.height_network import Network  # System has found a version of LLVM that works

    space, freeform = system.space(), system.problem.lens.rear.freeform
    model, bound = system.model(space, (257, 257)), freeform.z_freedom
    network = Network(kind, space.kv_u.dim, freeform.degree)
    loss = loss_through(network, model, model.target, bound)
    theta = optics.minimise(loss, network.start(seed=0), optics.Adam(step), iterations).coefficients
    return system.measure(system.lens(space, bound * network(theta)[0])).metrics


if __name__ == "__main__":
    for kind in ("dense", "sparse"):
        print(f"{kind}: rel_l2 {main(kind)['rel_l2']:.4f}")
