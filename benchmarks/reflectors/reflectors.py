"""Free mirrors before light of others' own, to the far field: how close, by whose measure, and in what time.

Source and chart are classes of this benchmark that no problem file names.  The mirror is a height over a
plane, as everywhere here.

Run: thbcad bench reflectors
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

import optics
from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import rel_l2_row
from benchmarks.reflectors import finite_sources as finite
from benchmarks.reflectors.far_sight import far_sighted
from benchmarks.reflectors.own_light import BACKWARD, Stereographic, StereographicPoint
from benchmarks.reflectors.wasserstein import distance, drawn_points
from benchmarks.rows.row import Row
from optics.base.runtime import load_backend
from optics.light.tracing import Tracer
from optics.scene.problem import load_problem
from optics.scene.receivers import Screen, formula_light
from optics.scene.sources import Rays
from thbcad.checks import Floats

WINDOW = 0.6  # half-width in u and v
RAYS, CELLS = 1 << 14, 512  # of the distance: rays of the source; of densities: cells each way
SEEDS = (1, 2)  # of points of the target, to which both rays and points like them are moved
PERFECT = (0, 3)  # of such points: sets differ by 1 to 2 %
DISTANCE = "distance of Wasserstein W2 in u, v"
AT_FLOOR = 1.05  # times the W2 of perfect light
PAIRED = "exact assignment of 2^14 rays to Sobol points, rms of two sets"
THEIRS = "Benamou, IJzerman, Rukhaia 2020: near its sampling floor, {} by their rays and W2"
MIRROR = {
    "element.M1.position": [0.0, 0.0, 0.0],
    "element.M1.tilt": [0.0, 0.0, 0.0],
    "element.M1.thickness": 170.0,
    "element.M1.reflectance": 1.0,
    "element.M1.face.half_width": [92.0, 92.0],
    "element.M1.face.radius": -100.0,
    "element.M1.face.conic": -0.6,
    "element.M1.face.freeform": {"z_freedom": 60.0, "spans": [8, 8], "max_level": 4},
    "target.position": None,
    "target.tilt": [0.0, 0.0, 0.0],
    "target.surface": "far_field",
    "target.half_width": [WINDOW, WINDOW],
    "target.pixels": [64, 64],
    "target.crossing": True,
    "optimizer.iterations": [600],
}


@dataclass(frozen=True)
class Case:
    """A case of the benchmark of ROMSOC: light of a point to a density per solid angle.

    round : the source lights a disk, and no square.  sphere : one about the source solves it.
    turned : so is the light asked for, but for the window's corners: the exact map is known.
    formula : of the density, x and y from -1 to 1.
    wanted : rel_l2.  changes : of the keys of MIRROR.  far_steps : by the loss of `far_sighted`.
    """

    formula: str
    wanted: float = 0.01
    round: bool = False
    sphere: bool = False
    turned: bool = False
    height: float = 78.0
    changes: Mapping[str, object] = field(default_factory=dict)
    far_steps: tuple[int, ...] = ()

    @property
    def source(self) -> StereographicPoint:
        return StereographicPoint(flux=1.0, distance=self.height, half=0.5, round=self.round)

    def designed(self) -> optics.Design:
        per_area = f"({self.formula}) / (1 + {WINDOW**2} * r^2)^2"  # by its mean over every pixel
        keys = (
            MIRROR
            | {"target.kind": "function", "target.formula": per_area, "source.distance": self.height}
            | self.changes
        )
        problem = load_problem(EXAMPLES / "lamp_reflector.toml").with_(**keys)
        design = optics.design(
            problem, source=self.source, receiver=Stereographic(BACKWARD, per_solid_angle=False)
        )
        return far_sighted(design, self.far_steps) if self.far_steps else design

    def density(self) -> Floats:
        """Return the light per solid angle asked for as that on cells of the chart, index order u, v."""
        screen = Screen((WINDOW, WINDOW), (CELLS, CELLS), 0, Stereographic())
        return (formula_light(self.formula, screen.pixels) * screen.projection())[::-1].T

    def rays(self) -> Rays:
        """Return rays of the same flux, spread like the light of the source."""
        cells = self.source.cells((CELLS, CELLS))
        s, t = drawn_points(RAYS, 1.0, cells.emitted, seed=0).T
        return cells.at(s, t, np.full(RAYS, self.source.flux / RAYS))

    def tracer(self, design: optics.Design) -> Tracer:
        """Return what traces these rays."""
        return Tracer(load_backend("double", 1), design.system.path, self.rays())

    def radius_deviation(self, design: optics.Design) -> float:
        """Return the rms deviation of the lit face from a sphere about the source, over its radius."""
        hits, _, _ = self.tracer(design).at(0)
        radius = np.linalg.norm([hits.x.numpy(), hits.y.numpy(), hits.z.numpy() + self.height], axis=0)
        return float(radius.std() / radius.mean())

    def landing(self, design: optics.Design) -> Floats:
        """Return where these rays land, (rays, 2)."""
        _, landing = self.tracer(design).trace()
        return np.c_[landing.x.numpy(), landing.y.numpy()]

    def drawn(self, seed: int) -> Floats:
        """Return points of the light asked for, (rays, 2)."""
        return drawn_points(RAYS, WINDOW, self.density(), seed)

    def distance(self, points: Floats) -> float:
        """Return W2 of points from sets of points of the light asked for, root mean square."""
        return float(np.sqrt(np.mean([distance(points, self.drawn(s)) ** 2 for s in SEEDS])))

    def perfect_landing(self) -> Floats:
        """Return where these rays go by the map of circles to those with the same shares, (rays, 2)."""
        density, direction = self.density(), self.rays().direction
        middles = WINDOW * ((2 * np.arange(CELLS) + 1) / CELLS - 1)
        radius = np.hypot(middles[:, None], middles).ravel()
        order = np.argsort(radius)
        within = np.cumsum(density.ravel()[order])
        # light is even per solid angle up to 2 atan(half) from the axis: its share within is as 1 - cos
        share = (1 - direction[2]) / (1 - np.cos(2 * np.arctan(self.source.half)))
        across = np.interp(share, within / within[-1], radius[order])
        return (direction[:2] * across / np.hypot(*direction[:2])).T * [-1, 1]


# with few pixels to a coefficient, light gathers within them
DISK = {"element.M1.face.freeform.max_level": 3, "target.pixels": [128, 128]}
# begun by the loss of pixels, which leaves light far away where little is asked for
BEGUN = DISK | {"optimizer.iterations": [60]}
# the last 3 % of the disk's radius, where little is asked for, go to the outer half of the picture: a start
# on a coarse mesh folds the light there, and no loss unfolds it
RIM = {
    "element.M1.face.freeform.spans": [64, 64],
    "element.M1.face.freeform.max_level": 1,
    "optimizer.iterations": [10],
}
# borders of pixels at those of the square, and more lit pixels than coefficients; cubics on this mesh end
# near 1e-6 of the radius, with cells left coarse or not
ALIGNED = {
    "element.M1.face.freeform.max_level": 3,
    "element.M1.face.freeform.degree": 5,
    "refinement.alpha": [0.0],
    "target.pixels": [90, 90],
    "optimizer.iterations": [400],
}
# light that leaves 80 degrees from the axis meets a rim beyond the lit face, or the far side of a bowl
SHALLOW = {
    "element.M1.face.half_width": [86.0, 86.0],
    "target.crossing": False,
    "optimizer.iterations": [200],
}
CASES = {
    "1: square to disk": Case("r < 5 / 6", changes=DISK),
    "2: square to wide Gaussian": Case("exp(-0.18 * r^2)", height=83.0, changes=SHALLOW),
    "3: square to square": Case("max(abs(x), abs(y)) < 5 / 6", sphere=True, changes=ALIGNED),
    "4: disk to Gaussian": Case(
        "exp(-5.76 * r^2)", 0.02, True, turned=True, height=85.0, changes=BEGUN | RIM, far_steps=(60,)
    ),
    "5: disk to two Gaussians": Case(
        "exp(-5.76 * hypot(x - 5 / 12, y - 5 / 12)^2) + exp(-5.76 * hypot(x - 5 / 12, y + 5 / 12)^2)",
        0.02,
        True,
        height=75.0,
        changes=BEGUN | RIM | {"element.M1.face.half_width": [90.0, 90.0]},
        far_steps=(100,),
    ),
}


def rows() -> list[Row]:
    """Return errors and seconds of every case."""
    points = [row for title, case in CASES.items() for row in case_rows(title, case)]
    return points + [row for title, case in finite.CASES.items() for row in finite.case_rows(title, case)]


def case_rows(title: str, case: Case) -> list[Row]:
    """Return the rows of a case of ROMSOC."""
    start = perf_counter()
    design = case.designed()
    seconds = perf_counter() - start
    light, floors = case.distance(case.landing(design)), [case.distance(case.drawn(s)) for s in PERFECT]
    floor = np.sqrt(np.mean(np.square(floors)))
    reference = THEIRS.format("2.31e-3" if case.round else "2.36e-3")
    sphere = "  deviation from a sphere about the source, rms"
    return [
        rel_l2_row(f"{title}: rel_l2", design.metrics, limit=case.wanted),
        Row("  W2 of its rays", light, "", reference, quantity=DISTANCE, estimator=PAIRED),
        Row(
            "  over the sampling floor",
            float(light / floor),
            "",
            "that of Sobol points of the target, rms of two sets",
            AT_FLOOR,
            quantity="W2 of a set of rays over that of a set of Sobol points of the target",
            estimator="exact assignment; the error is the spread of such sets",
            error=float(np.std(floors, ddof=1) / floor),
        ),
        *(_mapped_rows(light, case.distance(case.perfect_landing()), floor) if case.turned else []),
        *([Row(sphere, case.radius_deviation(design), "", "of its radius", 1e-6)] if case.sphere else []),
        Row("  design", seconds, "s"),
    ]


def _mapped_rows(light: float, mapped: float, floor: float) -> list[Row]:
    """Return what the exact map makes of the rays, which are less even than Sobol points."""
    quantity = "W2 of a set of rays over that of the same rays sent by the exact map"
    return [
        Row("  of the exact map's rays, over the sampling floor", mapped / floor),
        Row("  over that of the exact map's rays", light / mapped, "", "", AT_FLOOR, quantity=quantity),
    ]
