"""Graphs z(x, y) over rectangles round the origin: bounds of their slopes, segments and mirror images."""

import numpy as np

from thbcad.splines import BSplineSurface, KnotVector, tensor_apply

NEAR = 1e-12  # of a half-width: knots that agree but for rounding, as in `thbcad.sags`


def steepest(graph: BSplineSurface, axis: int) -> float:
    """Return a bound of the slope in x or y: the greatest control coefficient of the derivative."""
    kv, net = ((graph.kv_u, graph.coefficients), (graph.kv_v, graph.coefficients.T))[axis]
    p, t = kv.degree, kv.knots
    return float((p * abs(np.diff(net, axis=0)).max(axis=1) / (t[p + 1 : -1] - t[1 : -p - 1])).max())


def segment(graph: BSplineSurface, half: list[float]) -> BSplineSurface:
    """Return the graph over a smaller rectangle, which ends at a knot where one lies there but for
    rounding."""
    operators = []
    for kv, h in zip((graph.kv_u, graph.kv_v), half):
        near = [kv.breaks[np.argmin(abs(kv.breaks - end))] for end in (-h, h)]
        operators.append(
            kv.segment(*(float(b) if abs(b - end) <= NEAR * h else end for b, end in zip(near, (-h, h))))
        )
    (kv_u, a), (kv_v, b) = operators
    return BSplineSurface(kv_u, kv_v, tensor_apply(a, b, graph.coefficients))


def oriented(graph: BSplineSurface, axis: int, signs: tuple[int, int]) -> BSplineSurface:
    """Return the graph in coordinates of which the first runs along `axis`, mirrored in those whose sign is
    -1."""
    vectors = [graph.kv_u, graph.kv_v]
    net = graph.coefficients
    if axis:
        vectors = vectors[::-1]
        net = net.T
    for k, sign in enumerate(signs):
        if sign < 0:
            vectors[k] = KnotVector(vectors[k].degree, 0.0 - vectors[k].knots[::-1])
            net = np.flip(net, k)
    kv_u, kv_v = vectors
    return BSplineSurface(kv_u, kv_v, net)
