"""Spline geometry for freeform lenses: exact THB surfaces, closed lenses, CAD exchange.

Names are loaded when first used: ``import thbcad`` itself loads nothing heavy.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "KnotVector": "thbcad.bspline",
    "THBSpace": "thbcad.space",
    "BSplineSurface": "thbcad.surface",
    "THBSurface": "thbcad.surface",
    "Conic": "thbcad.conic",
    "FreeformSurface": "thbcad.lens",
    "Lens": "thbcad.lens",
    "read_lens": "thbcad.native",
    "write_lens": "thbcad.native",
    "read_step": "thbcad.cad.step",
    "write_step": "thbcad.cad.step",
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'thbcad' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
