"""What the transport map tells before a design: numbers left to the program, and what to expect."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.prediction.automatic import resolved as resolved
    from optics.prediction.blurred_picture import blur_limits as blur_limits, blur_sentence as blur_sentence
    from optics.prediction.expectation import Expectation as Expectation, expected as expected
    from optics.prediction.expectation_text import expectation_lines as expectation_lines
    from optics.prediction.foreseen_verdict import foreseen_misses as foreseen_misses

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
