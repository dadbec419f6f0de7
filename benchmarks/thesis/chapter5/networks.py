"""Study 5: networks whose outputs are the heights of the control points (thesis 5.5)."""

from benchmarks.thesis.chapter5.networks_page import TITLE, section
from benchmarks.thesis.chapter5.networks_pictures import pictures
from benchmarks.thesis.chapter5.networks_runs import runs

NUMBER = 5
__all__ = ["NUMBER", "TITLE", "pictures", "runs", "section"]
