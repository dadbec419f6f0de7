"""Curved spline faces, and faces compared bit for bit."""

import numpy as np

from thbcad.sags import Conic, meridian
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface, circular_arc, line, revolved, ruled

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
CIRCLE = circular_arc(3.0).transform([[1, 0], [0, 1], [0, 0]])
SURFACES = {
    "wave": WAVE,
    "lens": revolved(meridian(Conic(-30.0, 0.5), 8.0)),
    "part": revolved(meridian(Conic(9.0, 0.0), 8.0), np.pi),
    "sphere": revolved(circular_arc(5.0, np.pi, -np.pi / 2)),
    "torus": revolved(circular_arc(1.0, centre=(3.0, 0.0))),
    "cylinder": ruled(CIRCLE, CIRCLE.transform(np.eye(3), [0, 0, 5])),
    "cone": revolved(line([3, 0], [0, 4])),
}


def numbers(surface):
    """Return (points, weights, knots u, knots v)."""
    nurbs = NURBSSurface.from_bspline(surface) if isinstance(surface, BSplineSurface) else surface
    return nurbs.coefficients, nurbs.weights, nurbs.kv_u.knots, nurbs.kv_v.knots


def assert_same(read, written):
    assert len(read) == len(written)
    for a, b in zip(read, written):
        assert (a.kv_u.degree, a.kv_v.degree) == (b.kv_u.degree, b.kv_v.degree)
        # 0.0 and -0.0 are the same place
        assert all((x + 0.0).tobytes() == (y + 0.0).tobytes() for x, y in zip(numbers(a), numbers(b)))
