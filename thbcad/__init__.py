"""Spline geometry for freeform lenses: exact THB surfaces, closed lenses, CAD exchange.

Names are loaded when first used: ``import thbcad`` itself loads nothing heavy.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "KnotVector": "thbcad.bspline",
    "PeriodicKnotVector": "thbcad.periodic",
    "remove_knots": "thbcad.removal",
    "remove_surface_knots": "thbcad.removal",
    "THBSpace": "thbcad.space",
    "BSplineSurface": "thbcad.surface",
    "THBSurface": "thbcad.thb",
    "NURBSCurve": "thbcad.rational",
    "NURBSSurface": "thbcad.rational",
    "circular_arc": "thbcad.construction",
    "conic_arc": "thbcad.construction",
    "line": "thbcad.construction",
    "meridian": "thbcad.construction",
    "revolved": "thbcad.construction",
    "ruled": "thbcad.construction",
    "Conic": "thbcad.conic",
    "PolynomialSag": "thbcad.polynomials",
    "Approximation": "thbcad.approximation",
    "approximated": "thbcad.approximation",
    "error_bounds": "thbcad.approximation",
    "Enclosure": "thbcad.bounds",
    "value_range": "thbcad.bounds",
    "greatest_slope": "thbcad.curvature",
    "least_radii": "thbcad.curvature",
    "Samples": "thbcad.fitting",
    "Underdetermined": "thbcad.fitting",
    "interpolate": "thbcad.interpolation",
    "least_squares": "thbcad.fitting",
    "quasi_interpolate": "thbcad.quasi",
    "Fit": "thbcad.adaptive",
    "fit": "thbcad.adaptive",
    "FreeformSurface": "thbcad.lens",
    "Lens": "thbcad.lens",
    "read_lens": "thbcad.native",
    "write_lens": "thbcad.native",
    "read_surface": "thbcad.native_surface",
    "write_surface": "thbcad.native_surface",
    "Manufacturability": "thbcad.manufacture",
    "manufacturability": "thbcad.manufacture",
    "Product": "thbcad.product",
    "read_step": "thbcad.cad.step",
    "write_step": "thbcad.cad.step",
    "read_faces": "thbcad.cad.exchange",
    "write_faces": "thbcad.cad.exchange",
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'thbcad' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
