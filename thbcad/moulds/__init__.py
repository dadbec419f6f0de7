"""What moulds need of a lens: its size before the plastic shrinks, and the bodies that leave a mould, of one
lens or of several on a plate."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .body_walls import LAND_STEP, BodyOptions
    from .drafted_walls import DraftedWall
    from .inserts import FACES, INSERT_BACK, UNCHANGED, Factors, Insert, enlarged, shrinkage_factors
    from .moulded_body import MouldedBody, Solid
    from .plates import Made, Plate, lens_of, named_on_plate
    from .rolling_ball import RoundedEdge
    from .rounded_edges import rounded_off
    from .wall_rims import Foot

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
