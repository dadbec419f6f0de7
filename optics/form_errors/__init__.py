"""Errors of the form of front and rear as functions dh(x, y), and what they do to the light."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.form_errors.allowed_errors import (
        BandCost as BandCost,
        FormErrors as FormErrors,
        SideCost as SideCost,
        form_errors_of as form_errors_of,
    )
    from optics.form_errors.form_trace import (
        form_obstacle as form_obstacle,
    )
    from optics.form_errors.form_words import (
        FORM_HEAD as FORM_HEAD,
        form_rows as form_rows,
        form_sentences as form_sentences,
        height_text as height_text,
    )
    from optics.form_errors.height_errors import (
        Power as Power,
        Scaled as Scaled,
        Sine as Sine,
        SplineHeight as SplineHeight,
        Sum as Sum,
    )
    from optics.form_errors.local_formula import (
        LocalFormula as LocalFormula,
        local_formula_of as local_formula_of,
    )
    from optics.form_errors.period_bands import (
        BandFormula as BandFormula,
        period_bands_of as period_bands_of,
    )
    from optics.form_errors.pixel_transfer import (
        pixel_mtf as pixel_mtf,
    )
    from optics.form_errors.random_fields import (
        random_field as random_field,
    )

_FILES = {
    "allowed_errors": (
        "BandCost",
        "FormErrors",
        "SideCost",
        "form_errors_of",
    ),
    "form_trace": ("form_obstacle",),
    "form_words": (
        "FORM_HEAD",
        "form_rows",
        "form_sentences",
        "height_text",
    ),
    "height_errors": (
        "Power",
        "Scaled",
        "Sine",
        "SplineHeight",
        "Sum",
    ),
    "local_formula": (
        "LocalFormula",
        "local_formula_of",
    ),
    "period_bands": (
        "BandFormula",
        "period_bands_of",
    ),
    "pixel_transfer": ("pixel_mtf",),
    "random_fields": ("random_field",),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
