"""What a design starts from: slopes by optimal transport that send light where it is wanted."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.designing.starts.cell_sums import summed_over_cells
    from optics.designing.starts.rear_light import RearLight
    from optics.designing.starts.start_misfits import StartQuality, start_quality
    from optics.designing.starts.traced_light import light_before
    from optics.designing.starts.transport_start import (
        INSIDE,
        STEEP,
        TransportFit,
        TransportStart,
        least_auto,
        spot_system,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
