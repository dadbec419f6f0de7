"""Errors of the form of front and rear as functions dh(x, y), and what they do to the light."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.form_errors.height_errors import (
        HeightError as HeightError,
        Power as Power,
        Scaled as Scaled,
        Sine as Sine,
        SplineHeight as SplineHeight,
        Sum as Sum,
    )

_FILES = {
    "height_errors": (
        "HeightError",
        "Power",
        "Scaled",
        "Sine",
        "SplineHeight",
        "Sum",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
