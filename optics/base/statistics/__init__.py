"""Values and errors from a few independent measurements of the same light."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.base.statistics.replicates import (
        crossed_choice,
        crossed_error,
        drift_error,
        drift_signs,
        jackknife_error,
        root_error,
        standard_error,
        unbiased_square,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
