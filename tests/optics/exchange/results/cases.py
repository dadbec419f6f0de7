"""A state to keep, and a source with a picture."""

import numpy as np
from PIL import Image

from optics.designing.optimisation import Row, State
from tests.optics.cases import rough, small_space
from thbcad.surfaces import THBSurface

GLOW = {"source.profile": "image", "source.image": "glow.png"}


def some_state(stage=1, sags=1):
    space = small_space()
    history = Row(0, 49, 1, 0.1, 0.3, 0.25, 0), Row(0, 49, 2, 1 / 3, 1e-17, 1.5, 0, 0.7)
    surfaces = tuple(THBSurface(space, rough(space, seed=seed)) for seed in range(sags))
    return State(True, stage, surfaces, history)


def write_glow(folder, level=200):
    Image.fromarray(np.array([[10, 0], [0, level]], dtype=np.uint8)).save(folder / "glow.png")
