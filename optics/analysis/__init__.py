"""What a lens delivers, measured on fresh rays."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.analysis.judgement import (
        delivery_checks as delivery_checks,
        loss_notes as loss_notes,
        verdict as verdict,
    )
    from optics.analysis.lens_trace import (
        NEGLIGIBLE as NEGLIGIBLE,
        conservation as conservation,
        nonsequential as nonsequential,
        sections as sections,
        sequential as sequential,
        sequential_metrics as sequential_metrics,
    )
    from optics.analysis.light_fates import (
        fans as fans,
        nonsequential_metrics as nonsequential_metrics,
    )
    from optics.analysis.light_of_cells import (
        cell_irradiance as cell_irradiance,
    )
    from optics.analysis.metrics import (
        Measurement as Measurement,
        dark_fraction as dark_fraction,
        measure as measure,
        rel_l2 as rel_l2,
    )

_FILES = {
    "judgement": (
        "delivery_checks",
        "loss_notes",
        "verdict",
    ),
    "lens_trace": (
        "NEGLIGIBLE",
        "conservation",
        "nonsequential",
        "sections",
        "sequential",
        "sequential_metrics",
    ),
    "light_fates": (
        "fans",
        "nonsequential_metrics",
    ),
    "light_of_cells": ("cell_irradiance",),
    "metrics": (
        "Measurement",
        "dark_fraction",
        "measure",
        "rel_l2",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
