"""Integrals over regions by Green's theorem, against closed forms and whole rectangles."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.cases import examples
from thbcad.splines import BSplineSurface, KnotVector, Primitive, gauss_rule


@dataclass
class Graph:
    """A scalar spline f(u, v)."""

    spline: BSplineSurface

    def __call__(self, u, v):
        return self.spline(u, v)

    def grid(self, u, v):
        return self.spline.grid(u, v)


def graph(p, q, seed):
    rng = np.random.default_rng(seed)
    kv_u, kv_v = KnotVector.uniform(p, 5), KnotVector.uniform(q, 4)
    return Graph(BSplineSurface(kv_u, kv_v, rng.uniform(-1, 1, (kv_u.dim, kv_v.dim))))


@examples(30)
@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 99))
def test_the_primitive_is_the_integral_of_the_spline_up_to_u(p, q, seed):
    f = graph(p, q, seed)
    kv_u, kv_v = f.spline.kv_u, f.spline.kv_v
    primitive = Primitive(f, kv_u.breaks, kv_v.breaks, (p // 2 + 1, q + 1))
    for u, v in np.random.default_rng(seed).uniform(size=(5, 2)):
        x, w = gauss_rule(np.unique(np.r_[kv_u.breaks[kv_u.breaks < u], u]), p + 1)
        assert primitive(np.array([u]), np.array([v]))[0] == pytest.approx(
            w @ f(x, np.full(len(x), v)), abs=1e-14
        )


def test_a_disk_under_a_paraboloid():
    """The integral of u^2 + v^2 over the disk of radius r is pi r^4 / 2."""

    class Square:
        def __call__(self, u, v):
            return u**2 + v**2

        def grid(self, u, v):
            return self(u[:, None], v)

    lines = np.linspace(-2, 2, 4)
    t, w = gauss_rule(np.linspace(0, 2 * np.pi, 33), 16)
    u, v = 1.5 * np.cos(t), 1.5 * np.sin(t)
    total = (w * u) @ Primitive(Square(), lines, lines, (2, 3))(u, v)
    assert total == pytest.approx(np.pi * 1.5**4 / 2, rel=1e-13)
