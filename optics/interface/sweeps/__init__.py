"""Many variants of a problem: designed side by side, stored, and shown as tables and pictures."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .running import sweep
    from .sweep_folder import STORE
    from .sweep_rows import Sweep, SweepRow
    from .variant_work import Designed, Shared, Work
    from .variants import value_list

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
