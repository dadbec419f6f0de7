"""Optimisers of a function with its gradient behind one interface: first-order steps, line search, L-BFGS."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .gradient_steps import Adam, GradientDescent, Momentum, RMSProp
    from .iterations import Optimiser
    from .lbfgs import LBFGS
    from .line_search import LineSearch

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
