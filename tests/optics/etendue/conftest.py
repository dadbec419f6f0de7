"""Hypothesis profile: the same examples on every run, no time limit per example."""

from hypothesis import settings

settings.register_profile("etendue", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("etendue")
