"""Rays through the front and the rear of a lens within its part, by programs that share no code."""

from typing import NamedTuple

import numpy as np

from optics.base.runtime import Check
from optics.exchange.assemblies.light_proof import PartLight
from optics.exchange.verification import occt_trace, optiland_trace, trace_step
from optics.light.tracing import LandingPoints
from optics.scene.receivers import receiver_at
from thbcad.cad.parts import PlacedLens
from thbcad.certified import DIRECTIONS
from thbcad.checks import Floats
from thbcad.lens import OpticalForm, optical_forms

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


def landing_checks(placed: PlacedLens, part: PartLight, by_optiland: bool) -> list[Check]:
    """Return the Checks of the landing points of rays through the faces of a part against those through the
    lens in memory.

    Rays like those of the source are traced by OCCT's intersections with all faces of the part, and by
    optiland where it is wanted; the lens in memory by scipy.  Their fates count where the light is proven to
    be free: elsewhere trims may stop rays that are none of the light.
    """
    lens = part.lens
    origins, directions = _rays(part)
    target = receiver_at(lens.thickness + DISTANCE)
    flux = np.ones(len(origins))
    wanted = trace_step(Surfaces(*optical_forms(lens)), origins, directions, flux, lens.index, target)
    programs = {
        "OCCT's intersections": occt_trace(part.solid, part.optical, origins, directions, lens.index, target)
    }
    if by_optiland:
        programs["optiland's trace"] = optiland_trace(*placed.forms, origins, directions, lens.index, target)
    return [
        check for name, found in programs.items() for check in _compared(name, found, wanted, part.proven)
    ]


def _rays(part: PartLight) -> tuple[Floats, Floats]:
    """Return origins (n, 3) a little before the lit part of the front, and directions (n, 3): parallel to z,
    from the middle of the source, or from a point where that is not known."""
    front = part.lens.front
    x, y = (WITHIN * h * np.linspace(-1, 1, n) for h, n in zip(front.half_width, RAYS))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    grid = grid[(grid @ DIRECTIONS.T <= WITHIN * part.hulls.lit["front"]).all(axis=1)]
    points = np.column_stack([grid, front(*grid.T)])
    onward = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    if part.system is None or not part.system.source.from_afar:
        size = max(part.lens.front.half_width)
        onward = points - (SOURCE * size if part.system is None else np.array(part.system.source.middle))
        onward = onward / np.linalg.norm(onward, axis=1, keepdims=True)
    return points - BEFORE * onward, onward


def _compared(name: str, found: LandingPoints, wanted: LandingPoints, by_fate: bool) -> list[Check]:
    lit = [points.flux > 0 for points in (found, wanted)]
    both = lit[0] & lit[1]
    error = float(np.abs(found.points[both] - wanted.points[both]).max()) if both.any() else np.inf
    landing = Check(f"landing points by {name} with the part", error, LANDING, "mm")
    other = Check.none_of(f"rays with another fate by {name} with the part", (lit[0] != lit[1]).sum())
    return [other, landing] if by_fate else [landing]
