"""Knot vectors, tensor-product B-splines, NURBS and their operators."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .bsplines import BSplineCurve, BSplineSurface, Function, evaluate, interpolate
    from .knot_vector import QUADRATIC, UNIT, KnotVector
    from .nurbs import NURBSCurve, NURBSSurface
    from .nurbs_shapes import circular_arc, conic_arc, line, revolved, ruled
    from .polar_forms import bezier_rows, blossom, blossom_rows, greville_abscissae, halves
    from .region_quadrature import Integrand, Primitive, gauss_rule, grid_integral
    from .sparse_operators import band_matrix, banded_least_squares, csr_rows, tensor_apply
    from .spline_verbs import AnySurface

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
