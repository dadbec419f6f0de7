"""Gradients of a thin lens by f and d_o: symbolic, by differences, and by Dr.Jit's forward and reverse mode.

L(f, d_o) = (d_o f / (d_o - f) - d_i)^2,  d_i = 2  (thesis 4.3).  Run: python examples/thesis/gradients.py
"""

import numpy as np

from optics.base.runtime import load_backend

BACKEND = load_backend()  # Dr.Jit, with an LLVM that works
dr, Float = BACKEND.dr, BACKEND.Float
D_I, DIRECTIONS = 2.0, np.eye(2)


def loss(f, d_o):
    return (d_o * f / (d_o - f) - D_I) ** 2


def symbolic(f, d_o):
    return 2 * np.array([d_o**2, -(f**2)]) * (d_o * f / (d_o - f) - D_I) / (d_o - f) ** 2


def forward_difference(p, step):
    here = loss(*p)
    return np.array([loss(*(p + step * e)) - here for e in DIRECTIONS]) / step


def central_difference(p, step):
    return np.array([loss(*(p + step * e)) - loss(*(p - step * e)) for e in DIRECTIONS]) / (2 * step)


def forward_mode(p, direction):
    x = [Float(value) for value in p]
    dr.enable_grad(*x)
    for variable, length in zip(x, direction):
        dr.set_grad(variable, length)
    return dr.forward_to(loss(*x))[0]


def reverse_mode(p):
    x = [Float(value) for value in p]
    dr.enable_grad(*x)
    dr.backward(loss(*x))
    return np.array([dr.grad(variable)[0] for variable in x])


def main(f=4.0, d_o=10.0, step=1e-6):
    p = np.array([f, d_o])
    return {
        "symbolic": symbolic(*p),
        "forward difference": forward_difference(p, step),
        "central difference": central_difference(p, step),
        "forward mode": np.array([forward_mode(p, direction) for direction in DIRECTIONS]),
        "reverse mode": reverse_mode(p),
    }


if __name__ == "__main__":
    for name, (by_f, by_d_o) in main().items():
        print(f"{name:20} dL/df {by_f:.12f}, dL/dd_o {by_d_o:.12f}")
