"""What light meets on its way: surfaces and media up to a receiver, as one record with maps."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.paths.bodies import Body
    from optics.scene.paths.light_path import (
        AIR,
        BARE,
        LEAST_COSINE,
        Coats,
        HeightError,
        LightPath,
        Medium,
        SlopeErrors,
        Surface,
    )
    from optics.scene.paths.stops import Stop

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
