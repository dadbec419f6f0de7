"""What light a source can make at all: shift-invariant systems of finite etendue (thesis, chapter 7)."""

from optics.etendue.approximation import Approximation, approximate
from optics.etendue.chains import approximate_two_deltas
from optics.etendue.kernel import Kernel

__all__ = ["Approximation", "Kernel", "approximate", "approximate_two_deltas"]
