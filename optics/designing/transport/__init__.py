"""Optimal transport between densities of light, and the density to ask for."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.designing.transport.back_and_forth import Transport, transport_map
    from optics.designing.transport.poisson import height_from_slopes
    from optics.designing.transport.prewarp import LEAST_SHARE, prewarped

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
