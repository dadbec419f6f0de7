"""Mounts as tables, and lenses that have room for them."""

import copy

from tests.thbcad.cad.shapes.cases import CASES, rough
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic

FLAT = CASES["round"][0]  # 20 x 16 mm, flat front, 5 mm thick
CONCAVE = Lens(FreeformSurface((10, 8)), FreeformSurface((10, 8), Conic(40.0, -1.0), rough()), 3.0, 1.5)
FLAT_REAR = Lens(FreeformSurface((10, 8), Conic(60.0, -1.0), rough()), FreeformSurface((10, 8)), 6.0, 1.5)

SQUARE = {
    "flange": {"size": [40, 32], "thickness": 2, "chamfer": 0.3, "draft": 2},
    "holes": [{"at": [[15, 12], [-15, 12], [15, -12], [-15, -12]], "diameter": 2.2, "countersink": 4.0}],
    "pins": [{"at": [[0, 12], [0, -12]], "diameter": 2, "length": 3, "chamfer": 0.3, "side": "front"}],
    "bosses": [{"at": [[15, 0]], "diameter": 4, "bore": 1.5, "length": 2}],
    "gate": {"width": 4, "length": 5, "thickness": 1, "side": "-x"},
}
ROUND = {
    "flange": {"outline": "round", "diameter": 44, "thickness": 1.5, "chamfer": 0.2, "draft": 3},
    "holes": [{"circle": 36, "count": 3, "start": 30, "diameter": 3, "side": "front", "countersink": 5}],
    "pins": [{"circle": 36, "count": 3, "start": 90, "diameter": 2, "length": 3}],
    "gate": {"width": 4, "length": 5, "thickness": 1, "side": "+y"},
}
PLAIN = {"flange": {"size": [30, 26], "thickness": 1}}


def changed(table, **changes):
    """Return a copy of a mount's tables with other values: flange__thickness=3, holes__0__diameter=1."""
    result = copy.deepcopy(table)
    for key, value in changes.items():
        *path, last = key.split("__")
        at = result
        for step in path:
            at = at[int(step)] if isinstance(at, list) else at.setdefault(step, {})
        at[last] = value
    return result
