"""Study 7: the pearl by the thesis's method (6.3.1), with the controls that its claims need."""

from benchmarks.thesis.chapter6.pearl_page import NUMBER, TITLE, section
from benchmarks.thesis.chapter6.pearl_pictures import pictures
from benchmarks.thesis.chapter6.pearl_runs import runs

__all__ = ["NUMBER", "TITLE", "pictures", "runs", "section"]
