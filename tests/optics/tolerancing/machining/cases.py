"""Lenses of the small problem for tools."""

import numpy as np

from tests.optics.cases import small_lens, small_space

SPACE = small_space()


def bowl_lens(height=0.02):
    """The small lens with a rough sag on its concave rear."""
    return small_lens(sag=height * np.random.default_rng(4).standard_normal(SPACE.dim), space=SPACE)
