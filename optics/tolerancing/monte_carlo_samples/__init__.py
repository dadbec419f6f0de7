"""Lenses as they are made: errors at random within their tolerances, each lens traced by itself."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .monte_carlo_result import MonteCarlo
    from .random_errors import Draw, FormTolerance, each_set
    from .sample_batch import SampleBatch
    from .sampling import ErrorModel, Sampled, sample_lenses

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
