"""Functions and samples into THB surfaces."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from thbcad.fitting.adaptive_fit import (
        Fit as Fit,
        fit as fit,
    )
    from thbcad.fitting.least_squares_fit import (
        Samples as Samples,
        Underdetermined as Underdetermined,
        least_squares as least_squares,
    )
    from thbcad.fitting.quasi_interpolant import (
        quasi_interpolate as quasi_interpolate,
        quasi_interpolation as quasi_interpolation,
    )
    from thbcad.fitting.slope_fit import (
        fit_slopes as fit_slopes,
        level_misfits as level_misfits,
        seen_functions as seen_functions,
    )

_FILES = {
    "adaptive_fit": (
        "Fit",
        "fit",
    ),
    "least_squares_fit": (
        "Samples",
        "Underdetermined",
        "least_squares",
    ),
    "quasi_interpolant": (
        "quasi_interpolate",
        "quasi_interpolation",
    ),
    "slope_fit": (
        "fit_slopes",
        "level_misfits",
        "seen_functions",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
