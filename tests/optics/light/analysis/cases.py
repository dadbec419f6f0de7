"""Lenses with a rough sag, and their light."""

import numpy as np

from optics.light.analysis import cell_irradiance
from tests.optics.cases import HOLLOW, roughened, small_system

POINT = HOLLOW | {
    "lens.rear.freeform.spans": [4, 4],
    "source.kind": "point",
    "source.half_angle": 50.0,
    "source.exponent": 2.5,
    "source.distance": 2.0,
    "source.flux": 3.0,
    "target.half_width": [2000.0, 1500.0],
    "target.pixels": [40, 30],
}
WHOLE = {
    "beam": {},
    "round beam": {"source.profile": "round"},
    "curved front": {"lens.front.radius": 60.0, "source.half_width": [8.0, 8.0]},
    "point": POINT,
    "far field": {"target.distance": np.inf, "target.half_width": [30.0, 25.0]},
    "point, far field": POINT | {"target.distance": np.inf, "target.half_width": [60.0, 55.0]},
}


def through_plate(angle, index=1.5):
    """Return how much of unpolarised light passes a plane plate once, through both faces, by Fresnel's
    equations.  angle : in air."""
    outside, inside = np.cos(angle), np.sqrt(1 - (np.sin(angle) / index) ** 2)
    s = ((outside - index * inside) / (outside + index * inside)) ** 2
    p = ((index * outside - inside) / (index * outside + inside)) ** 2
    return ((1 - s) ** 2 + (1 - p) ** 2) / 2


class Made:
    """A problem with a rough sag on its rear."""

    def __init__(self, folder, changes, backend, height=0.1):
        system, self.backend = small_system(folder, changes), backend
        self.lens = roughened(system.base, height)
        self.system = system.with_lens(self.lens)
        self.screen = self.system.target.screen()

    def light(self, *counts):
        cells = self.system.source.cells(counts)
        return cell_irradiance(self.system.path, self.screen, cells, self.backend)

    def flux(self, image):
        return image.sum() * self.screen.pixel_area
