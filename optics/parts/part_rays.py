"""Rays through the front and the rear of a lens within its part, by programs that share no code."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from optics.runtime import Check
from optics.tracing import LandingPoints
from optics.verification import occt_trace, optiland_trace, trace_step
from thbcad.cad.parts import PlacedLens
from thbcad.lens import OpticalForm, optical_forms

if TYPE_CHECKING:
    from thbcad.lens import Lens

RAYS = (21, 22)  # in x and y: numbers without a ray on the axes of symmetry of both
WITHIN = 0.98  # of the half-widths: rays that meet the front
SOURCE = np.array([0.1, 0.2, -5.0])  # in widths of the front: light that meets it aslant
BEFORE = 0.1  # mm before the front, where rays start: what a mount shades is not asked
DISTANCE = 100.0  # mm behind the rear, a usual distance of a target
LANDING = 1e-8  # mm


class Surfaces(NamedTuple):
    """Front and rear, as the reference tracer takes them."""

    front: OpticalForm
    rear: OpticalForm


def landing_checks(placed: PlacedLens, lens: Lens, by_optiland: bool) -> list[Check]:
    """Return the Checks of the landing points of rays through the faces of a part against those through the
    lens in memory.

    Rays of a point source are traced by OCCT's intersections with all faces of the part, and by optiland
    where it is wanted; the lens in memory by scipy.
    """
    origins, directions = _rays(lens)
    target = lens.thickness + DISTANCE
    flux = np.ones(len(origins))
    wanted = trace_step(Surfaces(*optical_forms(lens)), origins, directions, flux, lens.index, target)
    solid = placed.in_lens_frame()
    programs = {
        "OCCT's intersections": occt_trace(solid, placed.numbers, origins, directions, lens.index, target)
    }
    if by_optiland:
        programs["optiland's trace"] = optiland_trace(*placed.forms, origins, directions, lens.index, target)
    return [check for name, found in programs.items() for check in _compared(name, found, wanted)]


def _rays(lens: Lens) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return origins (n, 3) a little before the front, and directions (n, 3) away from a point."""
    x, y = (WITHIN * h * np.linspace(-1, 1, n) for h, n in zip(lens.front.half_width, RAYS))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, lens.front.grid(x, y).ravel()])
    onward = points - SOURCE * max(lens.front.half_width)
    onward /= np.linalg.norm(onward, axis=1, keepdims=True)
    return points - BEFORE * onward, onward


def _compared(name: str, found: LandingPoints, wanted: LandingPoints) -> list[Check]:
    lit = [points.flux > 0 for points in (found, wanted)]
    both = lit[0] & lit[1]
    error = float(np.abs(found.points[both] - wanted.points[both]).max()) if both.any() else np.inf
    return [
        Check(f"rays with another fate by {name} with the part", int((lit[0] != lit[1]).sum()), 0, ""),
        Check(f"landing points by {name} with the part", error, LANDING, "mm"),
    ]
