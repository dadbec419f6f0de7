"""Knot vectors, tensor-product B-splines, NURBS and their operators."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .bsplines import BSplineCurve as BSplineCurve, BSplineSurface as BSplineSurface
    from .interpolation import Function as Function, evaluate as evaluate, interpolate as interpolate
    from .knot_vector import UNIT as UNIT, KnotVector as KnotVector
    from .nurbs import NURBSCurve as NURBSCurve, NURBSSurface as NURBSSurface
    from .nurbs_shapes import (
        circular_arc as circular_arc,
        conic_arc as conic_arc,
        line as line,
        revolved as revolved,
        ruled as ruled,
    )
    from .polar_forms import (
        bezier_rows as bezier_rows,
        blossom as blossom,
        blossom_rows as blossom_rows,
        greville_abscissae as greville_abscissae,
        halves as halves,
    )
    from .region_quadrature import (
        Integrand as Integrand,
        Primitive as Primitive,
        gauss_rule as gauss_rule,
        grid_integral as grid_integral,
    )
    from .sparse_operators import (
        band_matrix as band_matrix,
        banded_least_squares as banded_least_squares,
        csr_rows as csr_rows,
        tensor_apply as tensor_apply,
    )
    from .spline_verbs import AnySurface as AnySurface

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
