"""Small systems for the tests of form errors."""

import numpy as np

from tests.optics.cases import rough, small_system
from thbcad.surfaces import THBSurface

PLATE = {
    "lens.rear.radius": np.inf,
    "lens.rear.conic": 0.0,
    "target.distance": 200.0,
    "target.half_width": [10.0, 10.0],
}
POINT = {"source.kind": "point", "source.distance": 60.0, "source.half_angle": 8.0}
FAR = {"target.distance": np.inf, "target.half_width": [10.0, 10.0]}
COUNTS = (160, 160)


def system_and_lens(folder, changes=None, bumps=0.0):
    """Return the system of the small problem with changes, and its lens with bumps on the sag, mm."""
    drop = ("source.half_width",) if changes and changes.get("source.kind") == "point" else ()
    system = small_system(folder, changes, drop=drop)
    lens = system.base
    if bumps:
        (sag,) = lens.sags
        lens = lens.with_sags([THBSurface(sag.space, rough(sag.space, bumps))])
    return system, lens


def relative_error(found, wanted):
    """Return |found - wanted| / |wanted|."""
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))
