"""Study 8: the extended source by the thesis's method (6.3.2), with its flux beside that of other designs."""

from benchmarks.thesis.chapter6.extended_page import NUMBER, TITLE, section
from benchmarks.thesis.chapter6.extended_pictures import pictures
from benchmarks.thesis.chapter6.extended_runs import runs

__all__ = ["NUMBER", "TITLE", "pictures", "runs", "section"]
