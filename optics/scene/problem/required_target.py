"""What receives light, and where it lies: keys of the target that must go together."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isinf, pi

from optics.base.runtime import UserError
from optics.scene.problem.schema import StopSpec, Target


def require_target(target: Target) -> None:
    """Refuse a target without its light, without a place or with two, and one that its surface cannot hold.

    Raises UserError : names the key.
    """
    if target.kind == "image" and not target.image:
        raise UserError("the key target.image is missing; add it")
    if target.kind == "function" and not target.formula:
        raise UserError("the key target.formula is missing; add it")
    if target.kind != "image" and target.seen_from == "lens":
        raise UserError(
            'target.seen_from = "lens" turns a picture over; regions and formulas are given in x and y, see '
            "the page on targets"
        )
    _require_place(target)
    _require_surface(target)


def require_like_light(target: Target, stops: Sequence[StopSpec]) -> None:
    """Refuse what keeps the light of a plate from being that of one lens, shifted.

    Raises UserError : names the key.
    """
    if stops:
        raise UserError(
            "lens.array has no stops, which would stand beside one lens alone; leave out [[stop]]"
        )
    if not target.far_field and (target.curved or any(target.tilt) or target.position is not None):
        raise UserError(
            "lens.array shifts the light of one lens over a plane across the axis, or adds it in the far "
            "field: leave out target.position, target.tilt and target.radius"
        )


def _require_place(target: Target) -> None:
    """Refuse a target that lies nowhere, or at two places."""
    distance, position = target.distance, target.position
    if target.far_field:
        if position is not None:
            raise UserError(
                f"target.position is a place, got {list(position)}, and the far field has none; leave it "
                "out, and turn the far field by target.tilt"
            )
        if distance not in (None, inf):
            raise UserError(
                f'target.surface = "far_field" lies at no distance, got target.distance = {distance:g}; '
                "leave that out"
            )
    elif distance is None and position is None:
        raise UserError(
            "the key target.distance is missing (mm from the rear vertex to the middle of the target, on the "
            "axis; inf is the far field); add it, or target.position"
        )
    elif distance is not None and position is not None:
        raise UserError(
            f"target.distance = {distance:g} and target.position = {list(position)} say one place twice; "
            "leave one of them out, or set it to false"
        )


def _require_surface(target: Target) -> None:
    """Refuse a radius that the surface has not, and half-widths that reach beyond it."""
    surface, radius, half_width = target.surface, target.radius, list(target.half_width)
    if target.far_field:
        if surface not in ("plane", "far_field"):
            raise UserError(
                f'target.distance = inf is the far field, got target.surface = "{surface}"; give the '
                "distance or the position of its middle"
            )
        if max(half_width) >= 90:
            raise UserError(
                f"target.half_width must be less than 90 degrees in the far field, got {half_width}"
            )
    if target.curved and isinf(radius):
        raise UserError(
            f'the key target.radius is missing (mm, of target.surface = "{surface}"; above 0 it bulges to '
            "the light); add it"
        )
    if not target.curved and not isinf(radius):
        raise UserError(
            f'target.radius is that of target.surface = "cylinder" or "sphere", got {radius:g} with '
            f'"{surface}"; leave it out'
        )
    quarter = pi / 2 * abs(radius)
    for k in range(2 if surface == "sphere" else 1 if target.curved else 0):
        if half_width[k] >= quarter:
            raise UserError(
                f"target.half_width[{k}] must be less than a quarter turn of the {surface}, {quarter:.6g} mm "
                f"along its radius of {abs(radius):g} mm, got {half_width[k]:g}"
            )
