"""Non-negative approximation beside regularisation: the cases of Figures 7.9 to 7.12 of the thesis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from examples.thesis.chapter7.regularisation import (
    conjugate_gradients,
    laplacian_gradients,
    maximum_entropy,
)
from examples.thesis.chapter7.two_source_landscape import disk, square, two_sources
from optics.designing.etendue import Approximation, Kernel, Real, norm
from thbcad.checks import Floats

# of the target for the entropy, which depends on the unit; the thesis names none, 8-bit images have this peak
PEAK = 255.0


@dataclass(frozen=True)
class Case:
    """Two equal sources and a target.

    m, n : columns and rows from one source to the other
    mu : of the maximum entropy
    steps : of the conjugate gradients
    """

    figure: str
    shape: str
    m: int
    n: int
    mu: float
    steps: int

    @property
    def target(self) -> Floats:
        return {"square": square, "disk": disk}[self.shape]()

    @property
    def kernel(self) -> Kernel:
        return Kernel.points([(0, 0), (self.n, self.m)], [1, 1])


CASES = (
    Case("7.9", "square", 8, 0, 0.4642, 50),
    Case("7.10", "square", 6, 6, 0.4642, 50),
    Case("7.11", "disk", 0, 4, 0.315, 150),
    Case("7.12", "disk", 13, 4, 0.315, 150),
)


@dataclass(frozen=True, eq=False)
class Response:
    """The light of one method.

    light, image : (n, m), in the unit of the target
    residual : ||E * F - G|| / ||G||
    least : min F over max |F|
    """

    light: Real
    image: Real
    residual: float
    least: float


def compare(case: Case) -> tuple[Approximation, dict[str, Response]]:
    """Return the certified approximation, and the responses of all methods by name."""
    target, kernel = case.target, case.kernel
    best = two_sources(target, case.m, case.n)
    lights = {
        "non-negative": best.light,
        "maximum entropy": maximum_entropy(kernel, PEAK * target, case.mu) / PEAK,
        "conjugate gradients": conjugate_gradients(kernel, target, case.steps),
        "with Laplacian": laplacian_gradients(kernel, target, case.steps),
    }
    return best, {name: _response(kernel, target, light) for name, light in lights.items()}


def _response(kernel: Kernel, target: Floats, light: Real) -> Response:
    image = kernel.apply(np.pad(light, [(side // 2, side // 2) for side in kernel.weights.shape]))
    residual = norm(image - target) / norm(target)
    return Response(light, image, residual, float(light.min() / np.abs(light).max()))
