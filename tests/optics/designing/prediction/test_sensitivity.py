"""How far the light of several lenses moves by their indices, against traces of rays."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from optics.base.runtime import load_backend
from optics.designing.prediction.sensitivity import DECENTRE, INDEX, sensitivity
from optics.light.tracing import Tracer
from optics.scene.problem import Problem
from optics.scene.system import System
from tests.optics.cases import flat_problem

RIM = {"half_width": (15, 15)}
CONVEX = {"half_width": (16, 16), "radius": -60.0, "conic": -1.0, "freeform": False}
CONCAVE = {"half_width": (16, 16), "radius": 60.0, "conic": -1.0, "freeform": {"z_freedom": 1.0}}
TWO_LENSES = Problem(
    source={
        "kind": "point",
        "half_angle": 12.0,
        "distance": 50.0,
        "spectrum": [[450.0, 1.0], [640.0, 1.0]],
    },
    element=(
        {"kind": "lens", "name": "A", "material": "PMMA", "thickness": 10.0, "front": RIM, "rear": CONVEX},
        {
            "kind": "lens",
            "name": "B",
            "position": (0, 0, 20),
            "material": "PC",
            "thickness": 6.0,
            "front": RIM,
            "rear": CONCAVE,
        },
    ),
    target={"kind": "tophat", "position": (0, 0, 250), "half_width": (80, 60), "pixels": (24, 18)},
)


def test_dispersion_is_that_of_all_lenses_and_another_melt_that_of_one():
    """A gathers the light and B spreads it: what they do to colours cancels in part."""
    system, backend = System(TWO_LENSES), load_backend("double")
    found = sensitivity(system, backend)
    path, rays = system.path, system.source.rays((61, 59))
    *before, of_b, air = path.media
    denser = path.in_media([*before, replace(of_b, index=of_b.index + INDEX), air])
    by_colours = [path.in_media(system.media_at(nm)) for nm in (450.0, 640.0)]
    for shift, ends in ((found.grade, (path, denser)), (found.colours, by_colours)):
        landed = [Tracer(backend, end, rays).landed() for end in ends]
        apart = np.hypot(*(getattr(landed[1], k).numpy() - getattr(landed[0], k).numpy() for k in "xy"))
        assert shift == pytest.approx(apart.mean(), rel=0.01)
    falls = max(b.index - r.index for b, r in zip(*(system.media_at(nm) for nm in (450.0, 640.0))))
    assert abs(found.index / INDEX * falls / found.colours - 1) > 0.3


TILT = np.radians(60.0)


def turned(source):
    """Return the decentre of a plate of 6 mm before a plane turned by 60 degrees, 200 mm behind it."""
    target = {"distance": 200, "half_width": (30, 60), "tilt": (60, 0, 0)}
    rear = {"half_width": (10, 10), "freeform": {"spans": (2, 2), "z_freedom": 1.0}}
    system = System(flat_problem(source, target, {"rear": rear}))
    return sensitivity(system, load_backend("double")).decentre


def test_a_decentre_is_stretched_where_light_meets_the_target_at_an_angle():
    """Of a lens in a beam, and of a point: the ray through a fixed point of the rear, by Snell's law."""
    beam = {"kind": "collimated", "half_width": (5, 5)}
    assert turned(beam) == pytest.approx(DECENTRE / np.cos(TILT), rel=1e-9)
    found = turned({"kind": "point", "half_angle": 3.0, "distance": 20})
    steep = brentq(lambda u: 20 * np.tan(u) + 6 * np.tan(np.arcsin(np.sin(u) / 1.5)) - DECENTRE, 0, 0.1)
    height = 200 * np.tan(steep)  # beside the axis, at the middle of the target
    assert found == pytest.approx(height / np.cos(TILT), rel=1e-4)


@pytest.mark.parametrize("fold", [45.0, 30.0])
def test_a_decentre_before_a_fold_is_that_behind_it(fold):
    """A plane mirror turns the light, and the shift with it: a target across the light shows all of it."""
    lens = {"kind": "lens", "name": "L", "index": 1.5, "thickness": 5.0, "front": RIM, "rear": CONCAVE}
    face = {"half_width": (40, 40), "freeform": None}
    mirror = {"kind": "mirror", "name": "M", "position": (0, 0, 60), "tilt": (fold, 0, 0), "thickness": 5}
    y, z = np.sin(np.radians(2 * fold)), np.cos(np.radians(2 * fold))
    place = {"position": (0, 80 * y, 60 - 80 * z), "tilt": (2 * fold - 180, 0, 0)}
    problem = Problem(
        source={"kind": "collimated", "half_width": (5, 5)},
        element=(lens, mirror | {"face": face}),
        target={"kind": "tophat", "half_width": (30, 30), "pixels": (8, 8)} | place,
    )
    system = System(problem)
    found = sensitivity(system, load_backend("double")).decentre
    assert found == pytest.approx(DECENTRE, rel=1e-9)
