"""How far the light of several lenses moves by their indices, against traces of rays."""

from dataclasses import replace

import numpy as np
import pytest

from optics.base.runtime import load_backend
from optics.designing.prediction.sensitivity import INDEX, sensitivity
from optics.light.tracing import Tracer
from optics.scene.problem import Problem
from optics.scene.system import OpticalSystem

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
    system, backend = OpticalSystem(TWO_LENSES), load_backend("double")
    found = sensitivity(system, system.lens, backend)
    path, rays = system.path(system.lens), system.source.rays((61, 59))
    *before, of_b, air = path.media
    denser = path.in_media([*before, replace(of_b, index=of_b.index + INDEX), air])
    by_colours = [path.in_media(system.media_at(nm)) for nm in (450.0, 640.0)]
    for shift, ends in ((found.grade, (path, denser)), (found.colours, by_colours)):
        landed = [Tracer(backend, end, rays).landed() for end in ends]
        apart = np.hypot(*(getattr(landed[1], k).numpy() - getattr(landed[0], k).numpy() for k in "xy"))
        assert shift == pytest.approx(apart.mean(), rel=0.01)
    falls = max(b.index - r.index for b, r in zip(*(system.media_at(nm) for nm in (450.0, 640.0))))
    assert abs(found.index / INDEX * falls / found.colours - 1) > 0.3
