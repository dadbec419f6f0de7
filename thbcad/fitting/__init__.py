"""Functions and samples into THB surfaces."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .adaptive_fit import Fit, fit
    from .continuation import Continuation, cell_shares
    from .least_squares_fit import (
        Samples,
        height_field_samples,
        least_squares,
        robust_weights as robust_weights,
    )
    from .noisy_fit import NoisyFit, fit_noisy as fit_noisy
    from .normal_equations import Underdetermined
    from .quasi_interpolant import quasi_interpolate, quasi_interpolation as quasi_interpolation
    from .slope_fit import fit_slopes, level_misfits, seen_functions

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
