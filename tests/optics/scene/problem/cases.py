"""Problem files as text and as values."""

import math

import pytest

from optics.base.runtime import UserError
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import SMALL, rough, toml_text, write_problem
from thbcad.lens import manufacturability
from thbcad.surfaces import THBSurface

REQUIRED = (
    "source.kind",
    "lens.index",
    "lens.thickness",
    "lens.front.half_width",
    "lens.rear.half_width",
    "target.kind",
    "target.image",
    "target.distance",
    "target.half_width",
)
MINIMAL = {key: SMALL[key] for key in ("source.half_width", *REQUIRED)}
EXTENDED = SMALL | {
    "source.kind": "lambertian",
    "source.profile": "image",
    "source.image": "glow.png",
    "source.half_angle": 60.0,
    "lens.front.freeform.degree": 4,
    "lens.front.freeform.spans": [3, 2],
    "lens.front.freeform.max_level": 1,
    "lens.front.freeform.z_freedom": 0.25,
    "target.distance": math.inf,
    "target.half_width": [30.0, 89.0],
}
MIRROR = """
title = "mirror"

[source]
kind = "collimated"
half_width = [9.5, 6.5]
distance = 30.0

[[element]]
kind = "mirror"
name = "M1"
tilt = [45, 0, 0]
thickness = 4.0
face = { half_width = [10.0, 10.0], freeform = { spans = [4, 4], max_level = 1, z_freedom = 1.0 } }

[target]
kind = "tophat"
position = [0, 60, 0]
tilt = [-90, 0, 0]
half_width = [20.0, 20.0]
pixels = [32, 32]
"""
LENS = """
[[element]]
kind = "lens"
name = "L1"
index = 1.5
thickness = 6.0
position = [0, 0, 2]
front = { half_width = [10.0, 10.0] }
rear = { half_width = [10.0, 10.0] }
"""
FIXED = LENS.replace("[0, 0, 2]", "[0, 0, -20]").replace("rear = { ", "rear = { freeform = false, ")
ROW = MIRROR.replace("[[element]]", f"{FIXED}\n[[element]]")  # a fixed lens, then the free mirror


def load_text(folder, text):
    path = folder / "problem.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8"))
    return load_problem(path)


def load_values(folder, values):
    return load_text(folder, toml_text(values))


def one_sentence(message):
    return bool(message) and "\n" not in message and "Traceback" not in message and len(message) < 600


def refusal(make, *arguments, **options):
    """Return the sentence with which a call is refused."""
    with pytest.raises(UserError) as caught:
        make(*arguments, **options)
    assert one_sentence(str(caught.value))
    return str(caught.value)


def read_or_refused(folder, text):
    """Return the Problem of a text, or the message with which it is refused."""
    try:
        return load_text(folder, text)
    except UserError as error:
        return str(error)


DENSITY = 1.19
# so much freedom that no limit below is refused as one that cannot be kept
ROOMY = {"lens.density": DENSITY, "lens.rear.freeform.z_freedom": 4.0}
FREE_FRONT = {
    "lens.front.freeform.spans": [3, 4],
    "lens.front.freeform.max_level": 1,
    "lens.front.freeform.z_freedom": 0.5,
}


def designed(folder, changes=None, height=0.05):
    """Return (problem, lens, found): a small problem with a density, its lens with a rough sag, and the
    lens's figures."""
    problem = load_problem(write_problem(folder, ROOMY | (changes or {})))
    base = System(problem).base
    lens = base.with_sags([THBSurface(sag.space, rough(sag.space, height)) for sag in base.sags])
    return problem, lens, manufacturability(lens, DENSITY)
