"""Many variants of a problem: designed side by side, stored, and shown as tables and pictures."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.sweeps.running import (
        sweep as sweep,
    )
    from optics.sweeps.sweep_rows import (
        Sweep as Sweep,
        SweepRow as SweepRow,
    )
    from optics.sweeps.value_lists import (
        value_list as value_list,
    )

_FILES = {
    "running": ("sweep",),
    "sweep_rows": (
        "Sweep",
        "SweepRow",
    ),
    "value_lists": ("value_list",),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
