"""Random NURBS curves, and a curve as OpenCASCADE holds it."""

import numpy as np
from hypothesis import strategies as st
from OCP.Geom import Geom_BSplineCurve
from OCP.gp import gp_Pnt

from tests.thbcad.cases import knot_vectors, seeds
from thbcad.cad.occt_names import IntegerArray, PointArray, RealArray
from thbcad.splines.nurbs import NURBSCurve


@st.composite
def curves(draw, d=3, **options):
    """Random points within 1 and weights of ratio up to 100."""
    kv, rng = draw(knot_vectors(**options)), draw(seeds())
    return NURBSCurve(kv, rng.uniform(-1, 1, (kv.dim, d)), 10 ** rng.uniform(-1, 1, kv.dim))


def geom_curve(curve):
    values, counts = np.unique(curve.kv.knots, return_counts=True)
    poles, weights = PointArray(1, curve.kv.dim), RealArray(1, curve.kv.dim)
    for k, (point, weight) in enumerate(zip(curve.coefficients.tolist(), curve.weights.tolist()), 1):
        poles.SetValue(k, gp_Pnt(*point))
        weights.SetValue(k, weight)
    knots, multiplicities = RealArray(1, len(values)), IntegerArray(1, len(values))
    for k, (value, count) in enumerate(zip(values.tolist(), counts.tolist()), 1):
        knots.SetValue(k, value)
        multiplicities.SetValue(k, count)
    return Geom_BSplineCurve(poles, weights, knots, multiplicities, curve.kv.degree)
