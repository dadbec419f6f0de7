"""Sag functions z(x, y), and splines of them with a proven error."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .conic import Conic, meridian
    from .graphs import (
        CONIC_TOLERANCE,
        conic_graph,
        gap_graph,
        graph_of_poles,
        graph_poles,
        square_coefficients,
        volume_between,
    )
    from .placed_conic import NOT_BOUNDED, ConicCurve, ConicSection, PlacedConic, axes, patch_numbers
    from .polynomial_sag import PolynomialSag, osa_orders as osa_orders, zernike as zernike
    from .proven_approximation import (
        Approximation,
        BoundedFunction,
        approximated,
        error_bounds,
        lobatto_nodes,
    )
    from .recognised_conics import conic_of_patch, conic_of_plane, conic_of_sphere, rectangle_around

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
