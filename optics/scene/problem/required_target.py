"""What receives light, and where it lies: keys of the target that must go together."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isinf, pi

from optics.base.runtime import UserError
from optics.scene.problem.run_schema import Verify
from optics.scene.problem.target_schema import StopSpec, Target, Zone

MOST_APERTURES = 2048  # across a target: zones are read in light that is measured on finer pixels
LEAST_CORNERS = {"points": 1, "box": 2, "line": 2, "polygon": 3, "whole": 0}


def require_target(target: Target) -> None:
    """Refuse a target without its light, without a place or with two, and one that its surface cannot hold.

    Raises UserError : names the key.
    """
    if target.kind == "image" and not target.image:
        raise UserError("the key target.image is missing; add it")
    if target.kind == "function" and not target.formula:
        raise UserError("the key target.formula is missing; add it")
    _require_place(target)
    _require_surface(target)
    if target.kind == "zones" and not target.zones:
        raise UserError('target.kind = "zones" needs a [[target.zone]] or target.regulation; add one')
    for name, zone in target.zones:
        _require_zone(name, zone, target)
    if target.aperture and not target.zones:
        raise UserError(
            f"target.aperture = {target.aperture:g} has no effect without zones; leave it out, which is 0, "
            "or add a [[target.zone]] or target.regulation"
        )
    least = 2 * max(target.half_width) / MOST_APERTURES
    if 0 < target.aperture < least:
        raise UserError(
            f"target.aperture = {target.aperture:g} is read on too many pixels; it must be at least "
            f"{least:.3g}, or target.half_width smaller"
        )


def require_angles(limits: Verify, target: Target) -> None:
    """Refuse limits of a beam's angles that no beam keeps, and such limits of light on a surface.

    Raises UserError : names the key.
    """
    for key in ("beam_angle", "field_angle"):
        least, greatest = pair = getattr(limits, key)
        if least > greatest or isinf(least) or not greatest:
            raise UserError(
                f"verify.{key} must be [least, greatest] in degrees with greatest > 0, such as [9, 11], "
                f"got {list(pair)}"
            )
        if (least or greatest < inf) and not target.far_field:
            raise UserError(
                f"verify.{key} limits a beam in the far field, and this target is a surface; leave it out, "
                "or set target.distance to inf"
            )


def require_like_light(target: Target, stops: Sequence[StopSpec]) -> None:
    """Refuse what keeps the light of a plate from being that of one lens, shifted.

    Raises UserError : names the key.
    """
    if stops:
        raise UserError(
            "lens.array has no stops, which would stand beside one lens alone; leave out [[stop]]"
        )
    if target.kind == "zones":
        raise UserError(
            "zones are limits of all the light, and lens.array designs one lens for its own part: leave out "
            "lens.array, and give source.flux the light of all lenses"
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
    quarter = pi / 2 * abs(radius)
    for k in range(2 if surface == "sphere" else 1 if target.curved else 0):
        if half_width[k] >= quarter:
            raise UserError(
                f"target.half_width[{k}] must be less than a quarter turn of the {surface}, {quarter:.6g} mm "
                f"along its radius of {abs(radius):g} mm, got {half_width[k]:g}"
            )


def _require_zone(name: str, zone: Zone, target: Target) -> None:
    """Refuse a zone without limits, with two shapes, or beside the target, and limits of another unit."""
    from optics.scene.receivers import chart_of_goniometer  # numpy, which files without zones do not need

    shapes = [shape for shape in LEAST_CORNERS if getattr(zone, shape, ())]
    if len(shapes) > 1 or not (shapes or zone.peak):
        got = " and ".join(shapes) or "none of them"
        raise UserError(f"{name} must have one of points, box, line and polygon, got {got}")
    shape, corners = zone.shape
    fewest = LEAST_CORNERS[shape]
    if len(corners) < fewest or (shape == "box" and len(corners) > fewest):
        exactly = "" if shape == "box" else "at least "
        raise UserError(f"{name}: {shape} must be {exactly}{fewest} rows [H, V], got {len(corners)}")
    if not zone.least and not zone.least_of_peak and isinf(zone.greatest):
        raise UserError(f"{name} has no limit; give it least or greatest")
    if zone.least > zone.greatest:
        raise UserError(
            f"{name}: least must be at most greatest, got {zone.least:g} and {zone.greatest:g}; exchange them"
        )
    unit = "cd" if target.far_field else "lx"
    if zone.unit not in ("", unit):
        place = "= inf" if zone.unit == "cd" else "to a number of mm"
        raise UserError(
            f"{name} has limits in {zone.unit}, and a target {target.place} has light in {unit}; set "
            f"target.distance {place}, or leave the zone out"
        )
    (wide, tall), turn = target.half_width, 90.0 if target.far_field else inf
    for h, v in corners:
        reached = abs(h), abs(float(chart_of_goniometer(h, v)[1])) if target.far_field else abs(v)
        if reached[0] > wide or abs(v) >= turn or reached[1] > tall:
            raise UserError(
                f"{name}: ({h:g}, {v:g}) lies outside the target, whose half_width is [{wide:g}, {tall:g}]; "
                "make that larger, or move the zone"
            )
