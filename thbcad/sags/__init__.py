"""Sag functions z(x, y), and splines of them with a proven error."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .conic import Conic as Conic, meridian as meridian
    from .graphs import (
        CONIC_TOLERANCE as CONIC_TOLERANCE,
        conic_graph as conic_graph,
        gap_graph as gap_graph,
        graph_of_poles as graph_of_poles,
        graph_poles as graph_poles,
        square_coefficients as square_coefficients,
        volume_between as volume_between,
    )
    from .placed_conic import (
        NOT_BOUNDED as NOT_BOUNDED,
        ConicCurve as ConicCurve,
        ConicSection as ConicSection,
        PlacedConic as PlacedConic,
        axes as axes,
        patch_numbers as patch_numbers,
    )
    from .polynomial_sag import PolynomialSag as PolynomialSag, osa_orders as osa_orders, zernike as zernike
    from .proven_approximation import (
        Approximation as Approximation,
        BoundedFunction as BoundedFunction,
        approximated as approximated,
        error_bounds as error_bounds,
        lobatto_nodes as lobatto_nodes,
    )
    from .recognised_conics import (
        conic_of_patch as conic_of_patch,
        conic_of_plane as conic_of_plane,
        conic_of_sphere as conic_of_sphere,
        rectangle_around as rectangle_around,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
