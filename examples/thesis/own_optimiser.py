"""An own optimiser: any object with a method `run` will do (thesis 4.2).

A step along the negative gradient is kept only where the loss falls.  The next one is then longer, or else
shorter.  An arctangent bounds the coefficients.  Run: python examples/thesis/own_optimiser.py
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import optics

PROBLEM = Path(__file__).parent / "optimisers.toml"
LONGER, SHORTER = 1.5, 0.5


@dataclass(frozen=True)
class AcceptedSteps:
    """step : of the first trial, in the variable with the greatest entry of the gradient."""

    step: float = 0.01

    def run(self, function, start, iterations, callback):
        x, (value, gradient) = start, function(start)
        length = self.step / (np.abs(gradient).max() or 1.0)
        for k in range(iterations):
            trial = x - length * gradient
            found, slope = function(trial)
            if found < value:
                x, value, gradient, length = trial, found, slope, LONGER * length
                try:
                    callback(x)
                except StopIteration:
                    return k + 1
            else:
                length *= SHORTER
        return iterations


def main(iterations: int = 200, rays: tuple[int, int] = (513, 513)) -> tuple[float, float]:
    """Return the loss of the flat lens and the least one."""
    system = optics.System(optics.load_problem(PROBLEM))
    space, bound = system.space(level=2), system.problem.lens.rear.freeform.z_freedom
    model = system.model(space, rays)
    norm = np.linalg.norm(model.target)

    def loss(w):
        irradiance, pull = model.vjp(2 * bound / np.pi * np.arctan(w))
        difference = irradiance - model.target
        misfit = np.linalg.norm(difference)
        slope = pull(difference / (misfit * norm)) * 2 * bound / np.pi / (1 + w**2)
        return misfit / norm, slope

    found = optics.minimise(loss, np.zeros(space.dim), AcceptedSteps(), iterations)
    return found.losses[0], found.loss


if __name__ == "__main__":
    print("loss of the flat lens {:.3f}, least loss {:.3f}".format(*main()))
