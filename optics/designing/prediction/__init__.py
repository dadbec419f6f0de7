"""What the transport map tells before a design: numbers left to the program, and what to expect."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.designing.prediction.automatic import resolved
    from optics.designing.prediction.blurred_picture import blur_limits, blur_sentence
    from optics.designing.prediction.diffracted_light import diffraction, diffraction_of, in_waves
    from optics.designing.prediction.displaced_pictures import displaced_limits, displaced_sentence
    from optics.designing.prediction.expectation import LEAST_ERROR, Expectation, expected
    from optics.designing.prediction.expectation_text import expectation_lines
    from optics.designing.prediction.foreseen_verdict import foreseen_misses

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
