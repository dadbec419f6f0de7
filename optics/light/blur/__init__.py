"""Beams that diverge, rough surfaces and plates of lenses, as convolutions of sharp light; what to aim at."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.light.blur.convolution import Blur, BlurOnto, blur_of
    from optics.light.blur.displacements import Displacements, Spread, spreads_of
    from optics.light.blur.light_to_aim_at import aimed, aimed_light, aimed_through
    from optics.light.blur.source_images import patch_images, spot_rms, spot_width
    from optics.light.blur.spot_matrices import LandingShifts

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
