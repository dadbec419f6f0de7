"""Lenses whose STEP files are checked: every kind of source, front, rear and target."""

import numpy as np
import pytest

from optics.exchange.verification.step_file import StepFile
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import rough, write_problem
from thbcad import write_step
from thbcad.surfaces import THBSurface

SPLINES = {"lens.front.radius": 60.0, "lens.front.conic": -1.0}  # a paraboloid: both faces are splines
FREE_FRONT = {
    "lens.front.freeform.spans": [3, 4],
    "lens.front.freeform.max_level": 1,
    "lens.front.freeform.z_freedom": 0.5,
}
LAMBERTIAN = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 4.0}
POINT = {"source.kind": "point", "source.half_angle": 75.0, "source.distance": 4.0}
FAR = {"target.distance": np.inf, "target.half_width": [60.0, 60.0]}
LENSES = {
    "plane front": {},
    "paraboloid front": SPLINES,
    "sphere front": {"lens.front.radius": -400.0, "lens.rear.freeform.degree": 5},
    "hyperboloid rear": {"lens.rear.conic": -2.5, "lens.rear.radius": 200.0, "lens.rear.freeform.degree": 4},
    "small rear": {"lens.front.radius": 400.0, "lens.rear.half_width": [8.0, 9.0]},
    "large rear": {"lens.front.radius": -400.0, "lens.rear.half_width": [12.0, 11.0], "lens.thickness": 12.0},
    "dense net": {"lens.front.radius": 60.0, "lens.rear.half_width": [8.0, 9.0]},  # 259 x 259 poles
    "oblong": {
        "lens.front.half_width": [10.0, 6.0],
        "lens.rear.half_width": [10.0, 6.0],
        "lens.rear.freeform.degree": 4,
    },
    "totally reflecting corners": {"lens.rear.radius": 11.0},
    "degree 2": {"lens.rear.freeform.degree": 2},
    "free front": FREE_FRONT,
    "free curved front": FREE_FRONT
    | {"lens.front.radius": 60.0, "lens.front.conic": -1.0, "lens.thickness": 12.0},
    "lambertian": LAMBERTIAN,
    "lambertian, free front": LAMBERTIAN | FREE_FRONT,
    "point": POINT,
    "far field": FAR,
    "lambertian, free front, far field": LAMBERTIAN | FREE_FRONT | FAR,
    "a picture that glows": LAMBERTIAN | {"source.profile": "image", "source.image": "picture.png"},
}


# of these each shape once, with every kind of source and target among them
EVERY_SHAPE = (
    "plane front",
    "paraboloid front",
    "sphere front",
    "hyperboloid rear",
    "large rear",
    "oblong",
    "totally reflecting corners",
    "free curved front",
    "point",
    "lambertian, free front, far field",
)
EVERY_LENS = [
    pytest.param(changes, id=name, marks=[pytest.mark.slow] if name == "dense net" else [])
    for name, changes in LENSES.items()
]


def written(folder, changes=None):
    """Return (system, lens, STEP file) of `shaped`."""
    problem, lens = shaped(folder, changes)
    file = StepFile(folder / "lens.step")
    write_step(lens, file.path)
    return System(problem).with_lens(lens), lens, file


def shaped(folder, changes=None, height=0.05):
    """Return (problem, lens): the small problem's lens with a rough sag over three levels."""
    problem = load_problem(write_problem(folder, changes))
    base = System(problem).base
    space = base.rear.sag.space.refine({0: [(1, 1), (1, 2), (2, 2)]}).refine({1: [(2, 2), (3, 3), (4, 5)]})
    sags = [THBSurface(s, rough(s, height)) for s in [*(sag.space for sag in base.sags[:-1]), space]]
    return problem, base.with_sags(sags)
