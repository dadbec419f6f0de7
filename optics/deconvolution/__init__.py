"""Baselines and studies of the thesis's chapter 7."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.deconvolution.analytic import RectangleResponse as RectangleResponse
    from optics.deconvolution.bases import (
        approximate_in_basis as approximate_in_basis,
        irwin_hall as irwin_hall,
    )
    from optics.deconvolution.comparison import CASES as CASES, Response as Response, compare as compare
    from optics.deconvolution.deconvolution import (
        Case as Case,
        figure_7_4 as figure_7_4,
        least_eigenvalue as least_eigenvalue,
        uncovered_zero as uncovered_zero,
    )
    from optics.deconvolution.multiplicative import (
        blind_deconvolution as blind_deconvolution,
        richardson_lucy as richardson_lucy,
    )
    from optics.deconvolution.regularisation import conjugate_gradients as conjugate_gradients
    from optics.deconvolution.two_source_landscape import (
        MARKS as MARKS,
        STEPS as STEPS,
        disk as disk,
        landscape as landscape,
        square as square,
        two_sources as two_sources,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
