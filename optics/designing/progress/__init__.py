"""How far a design is: its phases drawn, its clock, and its notes."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.designing.progress.design_progress import DesignProgress, Notes, RunClock, Size
    from optics.designing.progress.progress_bar import drawing, time_words

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
