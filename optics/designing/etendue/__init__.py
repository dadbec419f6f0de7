"""What light a source can make at all, with bounds for every lens and for one blur (thesis, chapter 7)."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.designing.etendue.approximation import (
        Approximation,
        approximate as approximate,
        certified,
        descend,
        require_target,
    )
    from optics.designing.etendue.brightness_limit import UniversalBound, universal_bound as universal_bound
    from optics.designing.etendue.certificate import kkt_residual, norm, per_column_sum, scaled_bound
    from optics.designing.etendue.kernel import Kernel as Kernel, Real
    from optics.designing.etendue.problem_bounds import (
        FIXED,
        FIXED_QUICK,
        SEARCH,
        UNBOUND,
        OneBlur,
        base_rear,
        blur_sentence,
        curve_sentence,
        etendue_notes,
        images_bound,
        one_blur,
        one_blur_sentence,
        one_blur_tells,
        reached_sentences,
        rounded_down,
        stretchable,
        universal_lines,
        universal_sentence,
        usual_efficiency,
    )
    from optics.designing.etendue.silhouette import greatest_slack
    from optics.designing.etendue.source_image_bound import ImageBound, merged
    from optics.designing.etendue.throughput_bound import (
        Throughput,
        bounds_hold,
        image_half_width,
        radiance,
        rear_area,
        throughput,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
