"""Bounds c = b r(w) and penalties mu p(c) on the coefficients of a lens (thesis 4.4), with derivatives.

Run: python examples/thesis/constraints.py
"""

from pathlib import Path

import numpy as np

import optics

RANGES = {
    "tanh": lambda w: (np.tanh(w), 1 - np.tanh(w) ** 2),
    "arctan": lambda w: (2 / np.pi * np.arctan(w), 2 / np.pi / (1 + w**2)),
    "this project": lambda w: (w * (1 + w**8) ** (-1 / 8), (1 + w**8) ** (-9 / 8)),
}


def tikhonov(c, bound):
    return np.sum(c**2), 2 * c


def smoothness(c, bound):  # of the Laplacian of a square net; its border has the neighbours that exist
    steps = np.diff(np.eye(round(len(c) ** 0.5)), axis=0)
    second = -steps.T @ steps
    net = c.reshape(second.shape)
    laplacian = second @ net + net @ second
    return np.sum(laplacian**2), 2 * (second @ laplacian + laplacian @ second).ravel()


def barrier(c, bound):  # -log(b - c) - log(b + c)
    room = bound**2 - c**2
    return -np.sum(np.log(room)) if room.min() > 0 else np.inf, 2 * c / room


def entropy(c, bound):  # of the positive quantity p
    p = (c + bound) / (2 * bound)
    return np.sum(p * np.log(p)) if p.min() > 0 else np.inf, (np.log(np.maximum(p, 1e-300)) + 1) / (2 * bound)


PENALTIES = {"Tikhonov": tikhonov, "smoothness": smoothness, "barrier": barrier, "entropy": entropy}


def main(name="tanh", bound=0.5, iterations=40, rays=(257, 257)):
    """Return the misfit of a lens behind a range function, and its greatest |c| / b."""
    system = optics.System(optics.load_problem(Path(__file__).with_name("optimisers.toml")))
    model, start = system.model(system.space(), rays), np.zeros(system.space().dim)

    def loss(w):
        ratio, slope = RANGES[name](w)
        irradiance, pull = model.vjp(bound * ratio)
        difference = (irradiance - model.target) / np.linalg.norm(model.target)
        return np.sum(difference**2), bound * slope * pull(2 * difference / np.linalg.norm(model.target))

    found = optics.minimise(loss, start, iterations=iterations)
    return found.loss**0.5, float(np.abs(RANGES[name](found.coefficients)[0]).max())


if __name__ == "__main__":
    print(*((name, *main(name)) for name in RANGES), sep="\n")
