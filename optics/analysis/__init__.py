"""What a lens delivers, measured on fresh rays."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.analysis.lens_trace import (
        NEGLIGIBLE as NEGLIGIBLE,
        conservation as conservation,
        nonsequential as nonsequential,
        sections as sections,
        sequential as sequential,
    )
    from optics.analysis.light_fates import (
        fans as fans,
        nonsequential_metrics as nonsequential_metrics,
    )
    from optics.analysis.metrics import (
        Measurement as Measurement,
        measure as measure,
    )

_FILES = {
    "lens_trace": (
        "NEGLIGIBLE",
        "conservation",
        "nonsequential",
        "sections",
        "sequential",
    ),
    "light_fates": (
        "fans",
        "nonsequential_metrics",
    ),
    "metrics": (
        "Measurement",
        "measure",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
