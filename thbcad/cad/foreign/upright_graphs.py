"""Splines in graph form: with x and y along their parameters, and cut to a rectangle round the axis."""

import numpy as np

from thbcad.checks import Floats
from thbcad.splines import BSplineSurface, KnotVector, tensor_apply

CENTRED = 1e-6  # mm: how far the middle of front and rear may lie from the axis
SLIVER = 1e-6  # of the half-width: a narrower span or margin at the rim is rounding


def upright(kv_u: KnotVector, kv_v: KnotVector, poles: Floats) -> tuple[KnotVector, KnotVector, Floats]:
    """Return knots and poles with x rising along the first and y along the second parameter."""
    across = poles[-1, 0] - poles[0, 0]
    if abs(across[1]) > abs(across[0]):
        kv_u, kv_v, poles = kv_v, kv_u, poles.transpose(1, 0, 2)
    if poles[-1, 0, 0] < poles[0, 0, 0]:
        kv_u, poles = kv_u.reverse(), poles[::-1]
    if poles[0, -1, 1] < poles[0, 0, 1]:
        kv_v, poles = kv_v.reverse(), poles[:, ::-1]
    return kv_u, kv_v, poles


def centred(graph: BSplineSurface, half_width: Floats) -> BSplineSurface | None:
    """Return the same graph over a rectangle round the axis, None where a face extends beyond it.

    The rectangle is that round the face, or that of the graph where they differ by rounding.

    half_width : (2,) float, mm, of the face
    """
    operators = []
    for kv, own in zip((graph.kv_u, graph.kv_v), half_width.tolist()):
        h = min(-kv.start, kv.stop)
        if h < own * (1 - SLIVER) - CENTRED:
            return None
        if max(-kv.start, kv.stop) > own * (1 + SLIVER):
            h = min(h, own)
        knots = np.abs(kv.knots)
        h = float(knots[(knots > h * (1 - SLIVER)) & (knots < h)].min(initial=h))
        operators.append(kv.segment(-h, h))
    (kv_u, a), (kv_v, b) = operators
    return BSplineSurface(kv_u, kv_v, tensor_apply(a, b, graph.coefficients))
