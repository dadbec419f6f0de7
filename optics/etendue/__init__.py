"""What light a source can make at all, with certified bounds (thesis, chapter 7)."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.etendue.approximation import (
        Approximation as Approximation,
        approximate as approximate,
        certified as certified,
        require_target as require_target,
    )
    from optics.etendue.certificate import (
        kkt_residual as kkt_residual,
        norm as norm,
        per_column_sum as per_column_sum,
        scaled_bound as scaled_bound,
    )
    from optics.etendue.image_size import (
        image_half_width as image_half_width,
    )
    from optics.etendue.kernel import (
        Kernel as Kernel,
        Real as Real,
    )
    from optics.etendue.measured_images import (
        patch_images as patch_images,
    )
    from optics.etendue.nonnegative_solvers import (
        descend as descend,
    )
    from optics.etendue.problem_bounds import (
        LENS_CLASS as LENS_CLASS,
        QUICK as QUICK,
        ProblemBound as ProblemBound,
        certain_bound as certain_bound,
        etendue_note as etendue_note,
        limit_sentence as limit_sentence,
        problem_bound as problem_bound,
    )
    from optics.etendue.source_image_bound import (
        ImageBound as ImageBound,
    )
    from optics.etendue.throughput_bound import (
        Array as Array,
        Throughput as Throughput,
        rear_area as rear_area,
        throughput as throughput,
    )
    from optics.etendue.two_deltas import (
        approximate_two_deltas as approximate_two_deltas,
    )

_FILES = {
    "approximation": (
        "Approximation",
        "approximate",
        "certified",
        "require_target",
    ),
    "certificate": (
        "kkt_residual",
        "norm",
        "per_column_sum",
        "scaled_bound",
    ),
    "image_size": ("image_half_width",),
    "kernel": (
        "Kernel",
        "Real",
    ),
    "measured_images": ("patch_images",),
    "nonnegative_solvers": ("descend",),
    "problem_bounds": (
        "LENS_CLASS",
        "ProblemBound",
        "QUICK",
        "certain_bound",
        "etendue_note",
        "limit_sentence",
        "problem_bound",
    ),
    "source_image_bound": ("ImageBound",),
    "throughput_bound": (
        "Array",
        "Throughput",
        "rear_area",
        "throughput",
    ),
    "two_deltas": ("approximate_two_deltas",),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
