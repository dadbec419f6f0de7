"""Mirrors before finite sources, beside the cases of Hacking 2026 in three dimensions.

A design charges light beside the window like an error within it.  Theirs does not, so the script goes on by
a loss of its own, ||E - T||^2 / ||T||^2 on the window alone, from the model of the public API.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt
from time import perf_counter

import numpy as np

import optics
from benchmarks.checkout import EXAMPLES
from benchmarks.reflectors.own_light import BACKWARD, Stereographic
from benchmarks.reflectors.sloped_light import SlopedArea
from benchmarks.rows.row import Row
from optics.base.runtime import load_backend
from optics.light.tracing import Tracer
from optics.scene.problem import load_problem
from thbcad.checks import Floats

UNIT = 10.0  # mm, of their length 1
WINDOW = 0.3  # half-width in u and v
ROOM = 1.15  # of the mirror's half-width over that of its light
OWN_RAYS = 1024, 1024  # of the script's own loss
OWN_STEPS = 40
JUDGED = 1 << 13, 1 << 13  # rays: 2^26, as theirs
AT_ONCE = 1 << 21
YIN_YANG = (
    "where(r > 0.9, 0.2, where(hypot(x, y - 0.45) < 0.15, 0.2, where(hypot(x, y + 0.45) < 0.15, 1,"
    " where(hypot(x, y - 0.45) < 0.45, 1, where(hypot(x, y + 0.45) < 0.45, 0.2, where(x > 0, 1, 0.2))))))"
)


@dataclass(frozen=True)
class FiniteCase:
    """A case of theirs, in units of UNIT.

    reach : radius of the disk of slopes.  height : of the mirror over the source, their r within [0.1, 8].
    theirs : published rel_l2.  spread : sigma of Gaussian light on a square; else light is even on a disk.
    """

    reach: float
    height: float
    theirs: str
    formula: str = "1"
    spread: float = 0.0

    @property
    def source(self) -> SlopedArea:
        return SlopedArea(
            flux=1.0,
            distance=UNIT * self.height,
            half=0.3 * UNIT,
            reach=self.reach,
            round=not self.spread,
            sigma=(UNIT * self.spread, self.spread) if self.spread else None,
        )

    @property
    def problem(self) -> optics.Problem:
        half = ROOM * UNIT * (0.3 * (sqrt(2) if self.spread else 1) + self.reach * self.height)
        keys = {
            "source.distance": UNIT * self.height,
            "element.M1.position": [0.0, 0.0, 0.0],
            "element.M1.tilt": [0.0, 0.0, 0.0],
            "element.M1.thickness": 100.0,
            "element.M1.reflectance": 1.0,
            "element.M1.face.half_width": [half, half],
            "element.M1.face.radius": inf,
            "element.M1.face.freeform": {
                "z_freedom": min(100.0, 0.6 * half),
                "spans": [8, 8],
                "max_level": 2,
            },
            "target.position": None,
            "target.tilt": [0.0, 0.0, 0.0],
            "target.surface": "far_field",
            "target.half_width": [WINDOW, WINDOW],
            "target.pixels": [128, 128],
            "target.kind": "function",
            "target.formula": self.formula,
            "optimizer.iterations": [30 if self.reach else 120],
            "optimizer.window": "bspline" if self.reach else "cells",
            "optimizer.lost_flux_weight": 0.0,
        }
        return load_problem(EXAMPLES / "lamp_reflector.toml").with_(**keys)


CASES = {
    "A: Gaussian square to even window": FiniteCase(0.75, 7.0, "3.6 %, 2 s", spread=sqrt(0.2)),
    "B: disk to a yin-yang of our own": FiniteCase(0.75, 7.0, "6.4 %, 2 s, of another yin-yang", YIN_YANG),
    "C: disk, slopes 0, to even window": FiniteCase(0.0, 7.0, "2.9 %, 8 s"),
    "C: disk, slopes 0.22": FiniteCase(2 / 9, 7.0, "3.0 %, 8 s"),
    "C: disk, slopes 2": FiniteCase(2.0, 3.4, "4.0 %, 8 s"),
}


def case_rows(title: str, case: FiniteCase) -> list[Row]:
    """Return the rows of a case."""
    start = perf_counter()
    system, lens = designed(case)
    seconds = perf_counter() - start
    rel_l2, lost = judged(system, lens)
    reference = f"Hacking 2026, RTX 4090: {case.theirs}"
    return [
        Row(
            f"{title}: rel_l2",
            rel_l2,
            "",
            reference,
            quantity="light per du dv, 128^2 bins of the window, unit mean",
            estimator="2^26 fresh Sobol rays",
        ),
        Row("  light beside the window", lost),
        Row("  design", seconds, "s", "wanted 40 s", 40),
    ]


def designed(case: FiniteCase) -> tuple[optics.System, optics.Lens]:
    """Return the system of a case and its mirror."""
    light = {"source": case.source, "receiver": Stereographic(BACKWARD, per_solid_angle=False)}
    design = optics.design(case.problem, **light)
    system, sag = optics.System(case.problem, **light), design.lens.front.sag
    if not case.reach:  # measured by cells, and no light is blurred over the border
        return system, design.lens
    model = system.model(sag.space, rays=OWN_RAYS, window="bspline")
    scale = 1 / np.sum(model.target**2)

    def loss(c: Floats) -> tuple[float, Floats]:
        light, pull = model.vjp(c)
        missing = light - model.target
        return scale * float(np.sum(missing**2)), pull(2 * scale * missing)

    found = optics.minimise(loss, sag.coefficients, iterations=OWN_STEPS)
    return system, system.lens(sag.space, found.coefficients)


def judged(system: optics.System, lens: optics.Lens) -> tuple[float, float]:
    """Return rel_l2 of the light in the window by their estimator, and the share beside it."""
    optical, backend = system, load_backend("double", 2)
    screen, path = optical.target.screen(), optical.with_lens(lens).path
    light = np.zeros(screen.shape)
    for rays in optical.source.parts(JUDGED, np.random.default_rng(1), AT_ONCE):
        _, landing = Tracer(backend, path, rays).trace()
        points = np.stack([landing.x.numpy(), landing.y.numpy()], axis=1)
        light += screen.binned(points, landing.flux.numpy())
    wanted = optical.target.irradiance(screen, 1.0)
    off = light / light.mean() - wanted / wanted.mean()
    return float(np.linalg.norm(off) / np.linalg.norm(wanted / wanted.mean())), float(1 - light.sum())
