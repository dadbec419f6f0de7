"""Pictures of tolerances, form errors, tools and made lenses, drawn by matplotlib."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.making_figures.form_figures import (
        allowed_figure as allowed_figure,
    )

_FILES = {
    "form_figures": ("allowed_figure",),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
