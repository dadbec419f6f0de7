"""Forward and reverse mode by hand on the graph of the thin lens (thesis 4.3.3, 4.3.4).

    v1 = d_o   v2 = f   v3 = v1 v2   v4 = -v2   v5 = v1 + v4   v6 = 1 / v5   v7 = v3 v6   v8 = v7 - d_i
    v9 = v8^2 = L

Four entries of tables 4.2 and 4.3 are misprinted: the tangents of v5 and v9, the adjoints of v1 and v4.
Run: python examples/thesis/computational_graph.py
"""

import numpy as np

D_I = 2.0


def nodes(f, d_o):
    """Return v1 ... v9."""
    v3, v6 = d_o * f, 1 / (d_o - f)
    v8 = v3 * v6 - D_I
    return np.array([d_o, f, v3, -f, d_o - f, v6, v3 * v6, v8, v8**2])


def tangents(v, f, d_o):
    """Return the derivatives of the nodes v along the direction (f, d_o): forward mode."""
    v1, v2, v3, _, v5, v6, _, v8, _ = v
    t3 = v1 * f + v2 * d_o
    t5 = d_o - f
    t6 = -t5 / v5**2
    t7 = v3 * t6 + v6 * t3
    return np.array([d_o, f, t3, -f, t5, t6, t7, t7, 2 * v8 * t7])


def adjoints(v):
    """Return the derivatives of L by the nodes v: reverse mode."""
    v1, v2, v3, _, v5, v6, _, v8, _ = v
    a8 = 2 * v8
    a7 = a8
    a6, a3 = v3 * a7, v6 * a7
    a5 = -a6 / v5**2
    a4 = a5
    return np.array([v2 * a3 + a5, v1 * a3 - a4, a3, a4, a5, a6, a7, a8, 1.0])


def main(f=4.0, d_o=10.0):
    """Return value, tangent along f, tangent along d_o, and adjoint of every node, (9, 4)."""
    v = nodes(f, d_o)
    return np.column_stack([v, tangents(v, 1.0, 0.0), tangents(v, 0.0, 1.0), adjoints(v)])


if __name__ == "__main__":
    for number, row in enumerate(main(), 1):
        print(f"v{number}", *(f"{value:12.6f}" for value in row))
