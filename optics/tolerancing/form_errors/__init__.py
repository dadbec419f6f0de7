"""What errors of the form of front and rear do to the light, and how large they may be."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .allowed_errors import (
        FORM_HEAD,
        BandCost,
        FormErrors,
        SideCost,
        form_errors_of,
        form_rows,
        form_sentences,
        height_text,
    )
    from .form_trace import form_obstacle
    from .local_formula import LocalFormula, local_formula_of as local_formula_of
    from .period_bands import BandFormula, pixel_mtf

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
