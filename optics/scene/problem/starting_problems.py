"""Problem files to start from, one for every kind of task."""

from __future__ import annotations

import math
from importlib.resources import files
from typing import Any

from optics.scene.keys import AUTO, problem_to_toml
from optics.scene.problem.choices import SHORT
from optics.scene.problem.lens_schema import Freeform, Front, LensSpec, Rear
from optics.scene.problem.problem_record import Problem
from optics.scene.problem.source_schema import Source
from optics.scene.problem.target_schema import Target

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
    "optimizer.start": "flat",
    "optimizer.window": "bspline",
    "optimizer.window_degree": 3,
    "optimizer.merge": 2,
    "optimizer.rays_per_pixel": 8.0,
    "optimizer.lost_flux_weight": 0.0,
    "optimizer.roughness_weight": 1e-5,
}
EXTENDED = GLOW | {
    "optimizer.finish": 120,
    "lens.rear.freeform": {"spans": (2, 2), "max_level": 6, "z_freedom": 3.0},
    "optimizer.iterations": (60, 60, 60, 60, 60, 60, 20),
    "optimizer.dark_flux_weight": 0.04,
}
TWO_SURFACES = GLOW | {
    "optimizer.finish": 60,
    "optimizer.iterations": (72, 72, 72, 72, 72, 72, 20),
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


HALF_ANGLE = 30.0  # degrees, of the cone of a lamp's light that the lens takes
# half-width of an LED, mm, at most, and in parts of the lens's width where light is even and where it is a
# picture, which a larger one would blur
CHIP, EVEN, SHARP = 0.5, 0.01, 0.0025
REGIONS: dict[str, dict[str, Any]] = {  # by ASKED_LIGHT
    "square": {"kind": "tophat", "shape": "rectangle", "lit": (0.75, 0.75), "pixels": (128, 128)},
    "disk": {"kind": "tophat", "shape": "ellipse", "lit": (0.8, 0.8), "pixels": (128, 128)},
}


def commented_problem(name: str = "collimated") -> str:
    """Return a problem file to start from, with comments: every key, or of some tasks those that matter.

    name : one of STARTS.
    """
    if name in SHORT:
        return files("optics.scene.problem").joinpath(f"starts/{name}.toml").read_text("utf-8")
    return problem_to_toml(_picture().with_(**CHANGES[name]), notes=True)


def answered_problem(source: str, light: str, width: float) -> str:
    """Return a commented problem file by three answers; lengths are in proportion to the width of the lens.

    source : one of ASKED_SOURCES.  light : one of ASKED_LIGHT, or the path of a picture.  width : mm.
    """

    def mm(length: float) -> float:
        """Return a length of a lens that is 100 mm wide in this one."""
        return float(f"{length * width / 100:.6g}")

    def square(half_width: float) -> tuple[float, float]:
        return mm(half_width), mm(half_width)

    lamp: dict[str, Any] = {"distance": mm(60.0), "half_angle": HALF_ANGLE}
    chip = min(CHIP, width * (EVEN if light in REGIONS else SHARP))
    sources: dict[str, dict[str, Any]] = {
        "beam": {"kind": "collimated", "half_width": square(47.5)},
        "sun": {"kind": "collimated", "half_width": square(47.5), "divergence_profile": "sun"},
        "point": {"kind": "point", **lamp},
        "led": {"kind": "lambertian", "half_width": (chip, chip), **lamp},
    }
    parallel = source in ("beam", "sun")
    target = {"distance": mm(300.0), "half_width": square(100.0)}
    changes = {
        "source": sources[source],
        "lens.thickness": mm(20.0 if parallel else 35.0),
        "lens.front.half_width": square(50.0 if parallel else 45.0),
        "lens.rear.half_width": square(50.0),
        "target": target | REGIONS.get(light, {"kind": "image", "image": light}),
    }
    return problem_to_toml(_picture().with_(**changes), notes=True)


def _picture() -> Problem:
    """Return the problem of a picture by parallel light, whose base lens and levels the program chooses."""
    freeform = Freeform(max_level=AUTO, z_freedom=AUTO)
    return Problem(
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
