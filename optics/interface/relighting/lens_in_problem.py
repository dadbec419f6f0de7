"""A lens that is there already, in place of the one that a problem describes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from optics.base.runtime import UserError
from optics.scene.problem import Freeform, Problem
from optics.scene.system import System
from thbcad.hierarchy import THBSpace
from thbcad.lens import Lens
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

LEAST_FREEDOM = 1e-6  # mm, of a sag of zeros


def given_lens(problem: Problem, lens: Lens) -> tuple[Problem, Lens]:
    """Return a problem whose table [lens] describes a lens, and that lens.

    A lens of two conics gets a sag of zeros on its rear, as a problem has at least one free surface.  What
    shape does not tell (material, coatings, roughness, limits) is the problem's.

    Raises UserError : a problem with [[element]]; a mirror; an outline that no problem file knows.
    """
    if not isinstance(lens, Lens):
        raise UserError(f"a Lens of thbcad is wanted, got {lens!r}; thbcad.read_lens reads a file")
    if problem.lens is None:
        raise UserError("a lens that is there already lies on the axis: take a problem with [lens]")
    if lens.index == 1:
        raise UserError("a mirror, of index 1, is given where a lens is wanted")
    if lens.front.sag is None and lens.rear.sag is None:
        space = THBSpace(*(KnotVector.uniform(Freeform.degree, 1, -h, h) for h in lens.rear.half_width))
        lens = replace(lens, rear=lens.rear.with_sag(THBSurface(space, np.zeros(space.dim))))
    keys: dict[str, Any] = {"lens.thickness": lens.thickness, **_outline_keys(lens)}
    if System(problem).problem.optic.known_index != lens.index:
        keys["lens.index"] = lens.index
    for name, surface, _ in lens.faces:
        keys |= {
            f"lens.{name}.half_width": list(surface.half_width),
            f"lens.{name}.radius": surface.conic.radius,
            f"lens.{name}.conic": surface.conic.constant,
            f"lens.{name}.freeform": False if surface.sag is None else vars(_freeform(surface.sag)),
        }
    return problem.with_(**keys), lens


def _freeform(sag: THBSurface) -> Freeform:
    """Return the settings of a sag, whose knots need not be uniform."""
    kv_u, kv_v = sag.space.kv_u, sag.space.kv_v
    return Freeform(
        degree=max(kv_u.degree, kv_v.degree),
        spans=(kv_u.spans, kv_v.spans),
        max_level=sag.space.levels - 1,
        z_freedom=max(LEAST_FREEDOM, float(np.abs(sag.coefficients).max())),
    )


def _outline_keys(lens: Lens) -> dict[str, Any]:
    """Return the keys of the outline, whose corners are in proportion on front and rear."""
    larger = max((lens.front.outline, lens.rear.outline), key=lambda o: o.half_width)
    if larger.is_rectangle or larger.is_ellipse:
        return {
            "lens.outline": "rectangle" if larger.is_rectangle else "ellipse",
            "lens.corner_radius": 0.0,
        }
    if larger.corners[0] != larger.corners[1]:
        raise UserError(f"an outline of {larger.text()} is none that a problem file knows")
    return {"lens.outline": "rounded", "lens.corner_radius": larger.corners[0]}
