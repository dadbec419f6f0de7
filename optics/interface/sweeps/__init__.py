"""Many variants of a problem: designed side by side, stored, and shown as tables and pictures."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .running import SweepPlan as SweepPlan, run_sweep as run_sweep, sweep as sweep
    from .sweep_rows import Sweep as Sweep, SweepRow as SweepRow
    from .variant_work import Designed as Designed, Shared as Shared, Work as Work
    from .variants import value_list as value_list

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
