"""What moulds need of a lens: its size before the plastic shrinks, and the bodies that leave a mould."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .body_walls import BodyOptions as BodyOptions
    from .drafted_walls import DraftedWall as DraftedWall, Foot as Foot
    from .inserts import (
        FACES as FACES,
        UNCHANGED as UNCHANGED,
        Factors as Factors,
        Insert as Insert,
        enlarged as enlarged,
        shrinkage_factors as shrinkage_factors,
    )
    from .moulded_body import MouldedBody as MouldedBody, Solid as Solid, lens_of as lens_of
    from .rounded_edges import rounded_off as rounded_off

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
