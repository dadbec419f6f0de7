"""The thin lens of the thesis: all methods find the gradient, by hand, by differences and by Dr.Jit."""

import numpy as np
import pytest

from examples.thesis import computational_graph, gradients

# by hand: L = r^2, dL/df = 2 d_o^2/(d_o - f)^2 r, dL/dd_o = -2 f^2/(d_o - f)^2 r, r = d_o f/(d_o - f) - 2
REFERENCES = {  # d_o: L, dL/df, dL/dd_o at f = 4
    5.0: (324, 900, -576),
    10.0: (196 / 9, 700 / 27, -112 / 27),
    20.0: (9, 9.375, -0.375),
}
EXACT = ("symbolic", "forward mode", "reverse mode")


@pytest.mark.parametrize("d_o", REFERENCES)
def test_every_method_finds_the_gradient(d_o):
    value, *wanted = REFERENCES[d_o]
    assert gradients.loss(4.0, d_o) == pytest.approx(value, rel=1e-14)
    found = gradients.main(4.0, d_o)
    for name in EXACT:  # some roundings each
        np.testing.assert_allclose(found[name], wanted, rtol=1e-14)
    # truncation is less than 10 step at f/(d_o - f) <= 4, rounding less than 1e-16 L / (step |dL|)
    np.testing.assert_allclose(found["forward difference"], wanted, rtol=1e-5)
    np.testing.assert_allclose(found["central difference"], wanted, rtol=1e-8)


@pytest.mark.parametrize("d_o", REFERENCES)
def test_both_modes_on_the_graph_find_the_gradient(d_o):
    value, *wanted = REFERENCES[d_o]
    table = computational_graph.main(4.0, d_o)
    assert table[-1, 0] == pytest.approx(value, rel=1e-14)
    np.testing.assert_allclose(table[-1, 1:3], wanted, rtol=1e-14)  # tangents of v9
    np.testing.assert_allclose(table[[1, 0], 3], wanted, rtol=1e-14)  # adjoints of v2 and v1


def test_tangents_are_the_derivatives_of_all_nodes():
    """Against central differences of fourth order, whose error is about 1e-12 here."""
    f, d_o, h = 4.0, 10.0, 1e-3

    def along(a, b):
        (m2, m1, p1, p2) = (computational_graph.nodes(f + k * h * a, d_o + k * h * b) for k in (-2, -1, 1, 2))
        return (m2 - 8 * m1 + 8 * p1 - p2) / (12 * h)

    table = computational_graph.main(f, d_o)
    np.testing.assert_allclose(table[:, 1], along(1, 0), rtol=0, atol=1e-10)
    np.testing.assert_allclose(table[:, 2], along(0, 1), rtol=0, atol=1e-10)


def test_adjoints_are_the_derivatives_by_all_nodes():
    """What is added to a node moves L by its adjoint: the rest of the graph is run again from there."""

    def finished(v, changed):
        """Return v9 with one node changed and all nodes behind it computed again."""
        rules = [
            lambda v: v[0] * v[1],
            lambda v: -v[1],
            lambda v: v[0] + v[3],
            lambda v: 1 / v[4],
            lambda v: v[2] * v[5],
            lambda v: v[6] - computational_graph.D_I,
            lambda v: v[7] ** 2,
        ]
        for k, rule in enumerate(rules, 2):
            if k > changed:
                v[k] = rule(v)
        return v[8]

    table, h = computational_graph.main(), 1e-6
    for k in range(9):
        plus, minus = table[:, 0].copy(), table[:, 0].copy()
        plus[k] += h
        minus[k] -= h
        slope = (finished(plus, k) - finished(minus, k)) / (2 * h)
        # rounding of L = 22 by the step: 1e-9 and the third derivative times h^2
        assert table[k, 3] == pytest.approx(slope, abs=2e-7)
