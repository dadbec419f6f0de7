"""Systems without a free surface: traced, and not designed."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.designing.optimisation import transmitted_flux
from optics.light.tracing import Tracer
from optics.scene.problem import Problem
from optics.scene.system import solvable_system, traceable_system

SIZE = {"half_width": (10.0, 10.0)}
BEAM = {"kind": "collimated", "half_width": (5.0, 5.0)}
SCREEN = {"kind": "tophat", "distance": 60.0, "half_width": (20.0, 20.0), "pixels": (16, 16)}
PLATE = {"index": 1.5, "thickness": 6.0, "front": SIZE, "rear": SIZE | {"freeform": False}}
MIRROR = {"kind": "mirror", "name": "M1", "tilt": (45.0, 0.0, 0.0), "thickness": 8.0, "reflectance": 0.9}
ASIDE = SCREEN | {"distance": None, "position": (0.0, 60.0, 0.0), "tilt": (-90.0, 0.0, 0.0)}
SCENES = {
    "lens": ({"lens": PLATE}, SCREEN, "lens.rear.freeform", 0.96**2),
    "mirror": (
        {"element": [MIRROR | {"face": SIZE | {"freeform": False}}]},
        ASIDE,
        "element.M1.face.freeform",
        0.9,
    ),
    "row": (
        {"element": [{"kind": "lens", "name": "L1", **PLATE}]},
        SCREEN | {"distance": None, "position": (0.0, 0.0, 60.0)},
        "element.L1.rear.freeform",
        0.96**2,
    ),
}


@pytest.mark.parametrize("scene", SCENES)
def test_what_is_fixed_is_traced_and_refused_for_a_design(backend, scene):
    """Plane faces at right angles to the light, or at 45 degrees, send on what Fresnel's laws say."""
    optics, target, key, passing = SCENES[scene]
    problem = Problem(source=BEAM, target={k: v for k, v in target.items() if v is not None}, **optics)
    system = traceable_system(problem)
    assert system.sags == ()
    assert transmitted_flux(system, backend) == pytest.approx(passing, rel=1e-12)
    with pytest.raises(UserError, match=f"{key} = false leaves no surface to design; .* `thbcad trace`"):
        solvable_system(problem)


def test_a_fixed_biconvex_lens_has_its_focal_length(backend):
    """Rays near the axis: 1/f = (n - 1)(1/R1 - 1/R2 + (n - 1) d / (n R1 R2)), the lensmaker's equation."""
    n, radius, d = 1.5, 50.0, 6.0
    front, rear = {**SIZE, "radius": radius}, {**SIZE, "radius": -radius, "freeform": False}
    lens = {"index": n, "thickness": d, "front": front, "rear": rear}
    beam = BEAM | {"half_width": (0.01, 0.01)}
    focal = 1 / ((n - 1) * (2 / radius - (n - 1) * d / (n * radius**2)))
    back = focal * (1 - (n - 1) * d / (n * radius))
    system = traceable_system(Problem(source=beam, lens=lens, target=SCREEN | {"distance": back}))
    landed = Tracer(backend, system.path, system.source.rays((3, 3))).landed()
    assert np.abs([landed.x, landed.y]).max() < 1e-6
