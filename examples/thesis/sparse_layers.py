"""A layer of drjit.nn for nets of neurons: each takes those near it, and all have weights of their own.

    y_ij = b_ij + sum over |i - k| <= p, |j - l| <= q of w_ijkl x_kl

A convolution of (2p + 1) x (2q + 1) weights would share them between the neurons; this layer does not.
"""

import drjit as dr
import numpy as np
from drjit import nn
from drjit.llvm.ad import Bool, TensorXf64 as Tensor, UInt


def neighbours(shape: tuple[int, int], reach: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the neurons that each one takes, and which of them exist, both (neurons, (2p + 1)(2q + 1)).

    shape : of the net, neurons in x and y, numbered row by row.  reach : (p, q).
    """
    window = np.indices([2 * r + 1 for r in reach]).reshape(2, -1) - np.array(reach)[:, None]
    near = np.indices(shape).reshape(2, -1, 1) + window[:, None, :]
    exist = ((near >= 0) & (near < np.array(shape)[:, None, None])).all(axis=0)
    return np.where(exist, near[0] * shape[1] + near[1], 0), exist


class SparseLinear(nn.Module):
    """Locally connected neurons; weights of neighbours beyond the net's border count nowhere.

    shape : of the net, neurons in x and y.  reach : (p, q).
    weights : (neurons, (2p + 1)(2q + 1)).  bias : (neurons,).
    """

    DRJIT_STRUCT = {"weights": Tensor, "bias": Tensor}  # noqa: RUF012

    def __init__(self, shape: tuple[int, int], reach: tuple[int, int]) -> None:
        self.shape, self.reach = shape, reach
        self.weights = self.bias = None

    def _alloc(self, dtype: type, size: int, rng: object) -> tuple["SparseLinear", int]:
        out = SparseLinear(self.shape, self.reach)
        near, exist = neighbours(self.shape, self.reach)
        out.near, out.exist = (dtype(a.ravel()) for dtype, a in ((UInt, near), (Bool, exist)))
        out.weights, out.bias = dr.zeros(dtype, near.shape), dr.zeros(dtype, len(near))
        return out, len(near)

    def __call__(self, x: Tensor) -> Tensor:
        """Return y, (neurons, 1), of x, (neurons, 1)."""
        taken = dr.gather(type(x.array), x.array, self.near, self.exist)
        sums = dr.block_sum(self.weights.array * taken, self.weights.shape[1])
        return Tensor(sums + self.bias.array, (len(sums), 1))
