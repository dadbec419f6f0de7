"""The light that leaves a lens: rays and an intensity for other programs, where it is concentrated most."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.light.outgoing.concentration import Concentration, greatest_concentration
    from optics.light.outgoing.concentration_words import concentration_sentence, fire_warning
    from optics.light.outgoing.intensity_of_lens import OutgoingIntensity, outgoing_intensity
    from optics.light.outgoing.lit_points import cut_cost, least_half_widths, lit_parts
    from optics.light.outgoing.rays_of_lens import outgoing_rays
    from optics.light.outgoing.steps_on_target import OnTarget, StepsOnTarget

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
