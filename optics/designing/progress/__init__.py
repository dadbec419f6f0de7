"""How far a design is: its phases drawn, its clock, and its notes."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.designing.progress.design_progress import DesignProgress as DesignProgress, Size as Size
    from optics.designing.progress.notes import Notes as Notes
    from optics.designing.progress.progress_bar import drawing as drawing
    from optics.designing.progress.run_clock import RunClock as RunClock

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
