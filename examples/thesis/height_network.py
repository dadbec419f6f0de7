"""A network without input, whose outputs are heights of control points (thesis 5.5).

    out = tanh(W3 tanh(W2 tanh(w1 + b1) + b2) + b3)

"dense" has all weights; in "sparse" each neuron takes those whose splines overlap its own.
"""

from collections.abc import Callable

import drjit as dr
import numpy as np
from drjit import nn
from drjit.llvm.ad import Float64 as Float, TensorXf64 as Tensor, UInt

from examples.thesis.sparse_layers import SparseLinear, neighbours

SMALL = 1e-4  # "uniform" weights and biases start in U(-SMALL, SMALL)


def on_device(values: np.ndarray) -> Float:
    """Return a copy; a gather takes it, since other kernels may read past the end of numpy's memory."""
    return dr.gather(Float, Float(values), dr.arange(UInt, len(values)))


class Network:
    """The outputs, (n * n,) from -1 to 1, as a function of all weights and biases in one vector."""

    def __init__(self, kind: str, n: int, degree: int) -> None:
        shape, reach, sparse = (n, n), (degree, degree), kind == "sparse"
        hidden = [SparseLinear(shape, reach) if sparse else nn.Linear(n * n, n * n) for _ in range(2)]
        layers = nn.Linear(1, n * n), nn.Tanh(), hidden[0], nn.Tanh(), hidden[1], nn.Tanh()
        self.module = nn.Sequential(*layers).alloc(Tensor, 1)
        self.shapes = {name: value.shape for name, value in self.module.items()}
        self.sizes = [int(np.prod(shape)) for shape in self.shapes.values()]
        unused = 2 * np.count_nonzero(~neighbours(shape, reach)[1]) if sparse else 0
        self.parameters = int(sum(self.sizes) - unused)

    def start(self, seed: int, ordinary: bool = False) -> np.ndarray:
        """Return U(-a, a) with a = SMALL, or a = 1 / sqrt(inputs of the neuron), of ordinary size."""
        random = np.random.default_rng(seed)
        inputs = [shape[1] for shape in self.shapes.values() if len(shape) == 2]
        ends = np.repeat(inputs, 2) ** -0.5 if ordinary else [SMALL] * len(self.sizes)
        return np.concatenate([random.uniform(-a, a, size) for a, size in zip(ends, self.sizes)])

    def __call__(self, theta: np.ndarray) -> tuple[np.ndarray, Callable[[np.ndarray], np.ndarray]]:
        """Return the outputs, and the function that maps dL/d(outputs) to dL/d(theta)."""
        parts = np.split(theta, np.cumsum(self.sizes)[:-1])
        for (name, shape), part in zip(self.shapes.items(), parts):
            self.module[name] = Tensor(on_device(part), shape)
            dr.enable_grad(self.module[name])
        out = self.module(dr.ones(Tensor, (1, 1))).array

        def pull(slope: np.ndarray) -> np.ndarray:
            dr.backward(dr.sum(out * on_device(slope)))
            return np.concatenate([dr.grad(value).numpy().ravel() for value in self.module.values()])

        return out.numpy(), pull
