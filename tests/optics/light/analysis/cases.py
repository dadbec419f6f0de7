"""Lenses with a rough sag, and their light."""

import numpy as np

from optics.light.analysis import cell_irradiance
from optics.scene.problem import load_problem
from optics.scene.system import OpticalSystem
from tests.optics.cases import HOLLOW, rough, write_problem
from thbcad.surfaces import THBSurface

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


class Made:
    """A problem with a rough sag on its rear."""

    def __init__(self, folder, changes, backend, height=0.1):
        self.system, self.backend = OpticalSystem(load_problem(write_problem(folder, changes))), backend
        space = self.system.lens.rear.sag.space
        self.lens = self.system.lens.with_sags([THBSurface(space, rough(space, height))])
        self.screen = self.system.target.screen()

    def light(self, *counts):
        cells = self.system.source.cells(counts)
        return cell_irradiance(self.system.path(self.lens), self.screen, cells, self.backend)

    def flux(self, image):
        return image.sum() * self.screen.pixel_area
