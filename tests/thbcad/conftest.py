"""Hypothesis profile of the geometry tests: the same examples on every run, no time limit per example."""

from hypothesis import settings

settings.register_profile("thbcad", deadline=None, derandomize=True, max_examples=60)
settings.load_profile("thbcad")
