"""What light a source can make at all, with bounds for every lens and for one blur (thesis, chapter 7)."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.designing.etendue.approximation import (
        Approximation as Approximation,
        approximate as approximate,
        certified as certified,
        descend as descend,
        require_target as require_target,
    )
    from optics.designing.etendue.brightness_limit import (
        UniversalBound as UniversalBound,
        universal_bound as universal_bound,
    )
    from optics.designing.etendue.certificate import (
        kkt_residual as kkt_residual,
        norm as norm,
        per_column_sum as per_column_sum,
        scaled_bound as scaled_bound,
    )
    from optics.designing.etendue.kernel import Kernel as Kernel, Real as Real
    from optics.designing.etendue.problem_bounds import (
        CURVED as CURVED,
        FIXED as FIXED,
        FIXED_QUICK as FIXED_QUICK,
        SEARCH as SEARCH,
        OneBlur as OneBlur,
        base_rear as base_rear,
        blur_sentence as blur_sentence,
        curve_sentence as curve_sentence,
        etendue_notes as etendue_notes,
        images_bound as images_bound,
        one_blur as one_blur,
        one_blur_sentence as one_blur_sentence,
        reached_sentences as reached_sentences,
        rounded_down as rounded_down,
        stretchable as stretchable,
        universal_lines as universal_lines,
        universal_sentence as universal_sentence,
        usual_efficiency as usual_efficiency,
    )
    from optics.designing.etendue.silhouette import greatest_slack as greatest_slack
    from optics.designing.etendue.source_image_bound import ImageBound as ImageBound
    from optics.designing.etendue.throughput_bound import (
        Array as Array,
        Throughput as Throughput,
        bounds_hold as bounds_hold,
        image_half_width as image_half_width,
        radiance as radiance,
        rear_area as rear_area,
        throughput as throughput,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
