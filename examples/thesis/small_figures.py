"""Small figures of chapter 2: a pixel by two filters (2.35-2.38, Figure 2.6), and plates in a row (2.13).

    box       W(x) = 1 for |x| <= 1/2
    Gaussian  W(x) = g(x) - g(R) for |x| < R = 4 sigma,  g(x) = exp(-x^2 / (2 sigma^2)) / (sqrt(2 pi) sigma)

x in pixels from the middle of the pixel.  Run: python examples/thesis/small_figures.py
"""

from collections.abc import Callable

import numpy as np

PIXELS, RAYS, SEED = 5, 40, 3
SIGMA, CUT = 0.5, 4.0  # in pixels, and in sigma
POSITIONS = np.sort(np.random.default_rng(SEED).uniform(0, PIXELS, RAYS))  # of the rays, all of one radiance


def box(x: np.ndarray) -> np.ndarray:
    """Return W of the box filter (2.35)."""
    return np.where(np.abs(x) <= 0.5, 1.0, 0.0)


def gaussian(x: np.ndarray) -> np.ndarray:
    """Return W of the Gaussian filter (2.36, 2.37) in one dimension."""
    g = np.exp(-0.5 * np.minimum(np.abs(x) / SIGMA, CUT) ** 2)
    return (g - np.exp(-0.5 * CUT**2)) / (np.sqrt(2 * np.pi) * SIGMA)


def weights(window: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the weights of the rays by pixel, (PIXELS, RAYS); sums of rows are the pixels (2.38)."""
    return window(POSITIONS - (np.arange(PIXELS)[:, None] + 0.5))


def plates(count: int, reflectance: float = 0.04) -> float:
    """Return what uncoated plates in a row pass at normal incidence, with all reflections between faces.

    Face j = 1 ... 2 count takes f_(j-1) from the left and b_(j+1) from the right:
    f_j = T f_(j-1) + R b_(j+1),  b_j = R f_(j-1) + T b_(j+1),  f_0 = 1, nothing from the right.
    """
    faces, r, t = 2 * count, reflectance, 1 - reflectance
    left, right = np.eye(faces, k=-1), np.eye(faces, k=1)  # f_(j-1) of f, b_(j+1) of b
    both = np.eye(2 * faces) - np.block([[t * left, r * right], [r * left, t * right]])
    first = np.eye(faces)[0]
    return float(np.linalg.solve(both, np.concatenate([t * first, r * first]))[faces - 1])


def main() -> None:
    """Print the pixels, and (2.13) beside what plates pass."""
    print("box:     ", weights(box).sum(axis=1))
    print("Gaussian:", weights(gaussian).sum(axis=1).round(3))
    for count in (1, 2, 3):
        print(f"{count} plates: (2.13) {0.96 ** (2 * count):.4f}, all reflections {plates(count):.4f}")


if __name__ == "__main__":
    main()
