"""What the shapes of elements add to the loss: roughness, and limits that they exceed."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.designing.penalties.bending_limits import curvature_range
    from optics.designing.penalties.shape_loss import (
        ROOM,
        Part,
        ShapePenalty,
        limited_metrics,
        limited_part,
        shape_penalty,
    )
    from optics.designing.penalties.slope_distance import SlopeDistance

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
