"""The claims of the README, measured on this machine."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .audit_table import audit_data, audit_lines
    from .claims import CLAIMS, SLACK, Claim, Judged, Measured, judged
    from .experiments import Experiments, experiments_in

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
