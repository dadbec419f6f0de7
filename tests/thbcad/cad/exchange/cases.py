"""Spline faces and curves, compared bit for bit."""

import numpy as np

from thbcad.hierarchy import THBSpace
from thbcad.sags import Conic, meridian
from thbcad.splines import (
    BSplineSurface,
    KnotVector,
    NURBSCurve,
    NURBSSurface,
    circular_arc,
    conic_arc,
    line,
    revolved,
    ruled,
)
from thbcad.surfaces import THBSurface

KINDS = (".step", ".igs", ".brep")
CUBIC = KnotVector.uniform(3, 3)
WAVE = BSplineSurface(
    CUBIC,
    CUBIC,
    np.stack(
        [
            *np.meshgrid(CUBIC.greville(), CUBIC.greville(), indexing="ij"),
            np.sin(np.arange(36)).reshape(6, 6),
        ],
        -1,
    ),
)
CIRCLE = circular_arc(3.0).transformed([[1, 0], [0, 1], [0, 0]])
SURFACES = {
    "wave": WAVE,
    "lens": revolved(meridian(Conic(-30.0, 0.5), 8.0)),
    "part": revolved(meridian(Conic(9.0, 0.0), 8.0), np.pi),
    "sphere": revolved(circular_arc(5.0, np.pi, -np.pi / 2)),
    "torus": revolved(circular_arc(1.0, centre=(3.0, 0.0))),
    "cylinder": ruled(CIRCLE, CIRCLE.transformed(np.eye(3), [0, 0, 5])),
    "cone": revolved(line([3, 0], [0, 4])),
}
SPACE = THBSpace(CUBIC, CUBIC).refine({0: [(0, 0), (0, 1), (1, 0), (1, 1)]})
REFINED = THBSurface(SPACE, np.random.default_rng(0).uniform(size=(SPACE.dim, 3)))
TWISTED = np.sin(np.arange(18)).reshape(6, 3)
CURVES = {
    "circle": CIRCLE,
    "arc": circular_arc(2.0, 4.0, 1.0).transformed([[1, 0], [0, 1], [1, 1]]),
    "hyperbola": conic_arc([0, 0, 0], [1, 2, 3], [2, 0, 1], 3.0),
    "line": line([0, 0, 0.1], [1, 2, 3]),
    "twisted": NURBSCurve(CUBIC, TWISTED),
    "closed": NURBSCurve(CUBIC, np.concatenate([TWISTED[:-1], TWISTED[:1]])),
    "kinked": NURBSCurve(KnotVector(2, [0, 0, 0, 0.3, 0.3, 1, 1, 1]), TWISTED[:5], 1 + np.arange(5)),
}


def numbers(spline):
    """Return (points, weights, knots, ...)."""
    if isinstance(spline, NURBSCurve):
        return spline.points, spline.weights, spline.kv.knots
    nurbs = NURBSSurface.from_bspline(spline) if isinstance(spline, BSplineSurface) else spline
    return nurbs.points, nurbs.weights, nurbs.kv_u.knots, nurbs.kv_v.knots


def assert_same(read, written):
    assert len(read) == len(written)
    for a, b in zip(read, written):
        # of the same shapes, so of the same degrees; 0.0 and -0.0 are the same place
        assert [x.shape for x in numbers(a)] == [x.shape for x in numbers(b)]
        assert all((x + 0.0).tobytes() == (y + 0.0).tobytes() for x, y in zip(numbers(a), numbers(b)))
