"""Optimal transport: the map that carries one density of light over a rectangle into another."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.transport.back_and_forth import (
        TransportMap as TransportMap,
        transport_map as transport_map,
    )
    from optics.transport.poisson import (
        height_from_slopes as height_from_slopes,
    )

_FILES = {
    "back_and_forth": (
        "TransportMap",
        "transport_map",
    ),
    "poisson": ("height_from_slopes",),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
