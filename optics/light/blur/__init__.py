"""The blur of a beam that diverges and of rough surfaces, as a convolution of the sharp light."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.light.blur.convolution import Blur as Blur, Convolution as Convolution, blur_of as blur_of
    from optics.light.blur.light_to_aim_at import (
        aimed as aimed,
        aimed_light as aimed_light,
        aimed_through as aimed_through,
    )
    from optics.light.blur.source_images import (
        patch_images as patch_images,
        spot_rms as spot_rms,
        spot_width as spot_width,
    )
    from optics.light.blur.spot_matrices import (
        LandingShifts as LandingShifts,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
