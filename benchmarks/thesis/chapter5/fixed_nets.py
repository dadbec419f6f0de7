"""Study 4: lenses of fixed nets, and the step size of the optimiser (thesis 5.3, 5.4)."""

from benchmarks.thesis.chapter5.fixed_nets_page import TITLE, section
from benchmarks.thesis.chapter5.fixed_nets_pictures import pictures
from benchmarks.thesis.chapter5.fixed_nets_runs import runs

NUMBER = 4
__all__ = ["NUMBER", "TITLE", "pictures", "runs", "section"]
