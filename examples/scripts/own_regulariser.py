"""Shape a lens whose curvature varies little: an own charge for the sag beside the project's loss.

    L(c) = project's loss + w V(c) / V(start),    V(c) = c'Rc = int |D^3 sag|^2 dx dy

A tool follows such a sag more easily.
"""

from pathlib import Path

import numpy as np

import optics

PROBLEM = Path(__file__).parents[1] / "tophat_circle.toml"


def main(iterations: int = 60, weight: float = 1e-4) -> dict[str, float]:
    system = optics.System(optics.load_problem(PROBLEM))
    space = system.space(level=2)
    model, start = system.model(space, window="cells"), system.transport_start(space).coefficients
    x0, x1, y0, y1 = space.boxes.T  # of the cells; D^3 is taken in their middles
    area = ((x1 - x0) * (y1 - y0))[:, None]
    thirds = [space.collocation((x0 + x1) / 2, (y0 + y1) / 2, (3 - k, k)) for k in range(4)]
    variation = sum(n * d.T @ (d * area) for n, d in zip((1, 3, 3, 1), thirds))
    variation /= start @ variation @ start

    def loss(c: np.ndarray) -> tuple[float, np.ndarray]:
        value, gradient = model.loss(c)
        charge = weight * variation @ c
        return value + c @ charge, gradient + 2 * charge

    c = optics.minimise(loss, start, iterations=iterations).coefficients
    return {"variation": c @ variation @ c} | system.measure(system.lens(space, c)).metrics


if __name__ == "__main__":
    for weight in (0.0, 1e-4):
        found = main(weight=weight)
        print(f"weight {weight}: rel_l2 {found['rel_l2']:.4f}, variation {found['variation']:.3f}")
