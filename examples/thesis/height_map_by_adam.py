"""Fit a THB-spline to a height map by an optimiser, batch after batch (thesis section 6.2).

    L(c) = ||Z - z||,    dL/dZ = (Z - z) / L,    Z = A c             (6.4)

A holds the functions of the space at the vertices, z the wanted heights.  After every batch the cells with
great vertex gradients are refined.  Least squares on the same mesh gives the least L that there is.

Run: python -m examples.thesis.height_map_by_adam
"""

from dataclasses import dataclass

import numpy as np

import optics
from examples.height_map import ALPHA, GRID, Mean, height_map, leaf_mean, mark
from thbcad import KnotVector, Samples, THBSpace, THBSurface, least_squares

STEPS = (0.05, 0.017, 0.006, 0.002, 0.0006)  # of Adam: a third of the one before
SAMPLES = Samples.grid(GRID, GRID, height_map(GRID[:, None], GRID))


@dataclass(frozen=True, eq=False)
class Batch:
    """The surface after the steps on one mesh, the losses of the evaluations, and the least loss."""

    surface: THBSurface
    losses: tuple[float, ...]
    least: float


def batches(optimisers: list[optics.Optimiser], iterations: int, mean: Mean = leaf_mean) -> list[Batch]:
    """Return one batch per optimiser, from 10 x 10 control points at zero."""
    kv, done = KnotVector.uniform(3, 7), []
    surface = THBSurface(THBSpace(kv, kv), np.zeros(kv.dim**2))
    for optimiser in optimisers:
        if done:
            surface = surface.refine(mark(surface, SAMPLES, ALPHA, mean))
        matrix = surface.space.collocation(SAMPLES.u, SAMPLES.v)

        def loss(c: np.ndarray, matrix: object = matrix) -> tuple[float, np.ndarray]:
            residual = matrix @ c - SAMPLES.values
            return np.linalg.norm(residual), residual @ matrix / (np.linalg.norm(residual) or 1.0)

        found = optics.minimise(loss, surface.coefficients, optimiser, iterations)
        surface = THBSurface(surface.space, found.coefficients)
        least = loss(least_squares(surface.space, SAMPLES).coefficients)[0]
        done.append(Batch(surface, found.losses, float(least)))
    return done


def main(iterations: int = 150) -> list[Batch]:
    done = batches([optics.Adam(step) for step in STEPS], iterations)
    for b in done:
        print(f"{b.surface.space.dim:5d} control points: loss {min(b.losses):.4f}, least {b.least:.4f}")
    return done


if __name__ == "__main__":
    main()
