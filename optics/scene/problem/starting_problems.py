"""Problem files to start from, one for every kind of task."""

from __future__ import annotations

import math
from typing import Any

from optics.scene.problem.lens_schema import Freeform, Front, LensSpec, Rear
from optics.scene.problem.problem_record import Problem
from optics.scene.problem.schema import Source, Target
from optics.scene.problem.toml_records import AUTO, problem_to_toml

FAR_FIELD: dict[str, Any] = {
    "source.half_width": (9.5, 9.5),
    "lens.thickness": 8.0,
    "lens.front.half_width": (10.0, 10.0),
    "lens.rear": {"half_width": (10.0, 10.0), "radius": 30.0, "conic": -1.0},
    "lens.rear.freeform": {"max_level": 3, "z_freedom": 2.0},
    "target": {"kind": "tophat", "distance": math.inf, "half_width": (15.0, 15.0), "pixels": (128, 128)},
}
POINT: dict[str, Any] = {
    "source": {"kind": "point", "distance": 60.0, "half_angle": 30.0},
    "lens.thickness": 35.0,
    "lens.front.half_width": (40.0, 40.0),
    "lens.rear": {"half_width": (45.0, 45.0), "radius": -70.0, "conic": -1.0},
    "lens.rear.freeform": {"max_level": 5, "z_freedom": 8.0},
}
GLOW: dict[str, Any] = {  # Table 6.3 of the thesis
    "source": {"kind": "lambertian", "half_width": (0.5, 0.5)},
    "lens.thickness": 5.0,
    "lens.front": {"half_width": (5.0, 5.0), "radius": -5.0, "conic": -1.0},
    "lens.rear": {"half_width": (8.0, 8.0), "radius": -10.0, "conic": -1.0},
    "target": {"kind": "tophat", "shape": "crescent", "distance": 1000.0, "half_width": (2000.0, 2000.0)},
    "optimizer.window": "bspline",
    "optimizer.window_degree": 3,
    "optimizer.merge": 2,
    "optimizer.rays_per_pixel": 8.0,
    "optimizer.finish": 60,
    "optimizer.lost_flux_weight": 0.0,
    "optimizer.roughness_weight": 1e-5,
}
EXTENDED = GLOW | {
    "lens.rear.freeform": {"spans": (2, 2), "max_level": 6, "z_freedom": 3.0},
    "optimizer.iterations": 100,
    "optimizer.dark_flux_weight": 0.04,
}
TWO_SURFACES = GLOW | {
    "lens.front.freeform": {"spans": (2, 2), "max_level": 5, "z_freedom": 1.0},
    "lens.rear.freeform": {"spans": (2, 2), "max_level": 6, "z_freedom": 1.5},
}
CHANGES: dict[str, dict[str, Any]] = {  # by STARTS: what differs from a picture by parallel light
    "collimated": {},
    "far_field": FAR_FIELD,
    "point": POINT,
    "extended": EXTENDED,
    "two_surfaces": TWO_SURFACES,
}


def commented_problem(name: str = "collimated") -> str:
    """Return a problem file to start from: every key with a value and a comment.

    name : one of STARTS.
    """
    freeform = Freeform(max_level=AUTO, z_freedom=AUTO)
    picture = Problem(
        title="my lens",
        source=Source(kind="collimated", half_width=(47.5, 47.5)),
        lens=LensSpec(
            index=1.5,
            thickness=20.0,
            front=Front(half_width=(50.0, 50.0)),
            rear=Rear(half_width=(50.0, 50.0), radius=AUTO, conic=AUTO, freeform=freeform),
        ),
        target=Target(kind="image", image="picture.png", distance=300.0, half_width=(100.0, 100.0)),
    )
    return problem_to_toml(picture.with_(**CHANGES[name]), notes=True)
