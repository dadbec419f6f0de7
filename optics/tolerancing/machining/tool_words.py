"""What was found of a tool, as sentences and as plain data."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import Any

from optics.scene.limits import bound_data, position
from optics.tolerancing.machining.findings import RISE, RowCut, SpiralMotion, SurfaceFindings, ToolFindings
from optics.tolerancing.machining.tool_order import SPEED, ToolOrder
from thbcad.tools import Fit, Gaps

NM = 1e6  # of a mm
LONG = 24.0  # hours of one pass: no machine keeps its temperature so long
ENOUGH = 1.5  # times as large as a ball: a larger one is worth a word
VERDICTS = {
    "fits": "{tool} fits the {name} for certain",
    "does not fit": "{tool} does not fit the {name} for certain",
    "undecided": "it is undecided whether {tool} fits the {name}",
}
EXTENSION = "a polynomial of degree 5 in the angle that continues height, velocity and acceleration"


def tool_lines(findings: ToolFindings) -> list[str]:
    """Return what was found as sentences with units and positions."""
    lines = []
    if findings.lenses > 1:
        lines.append(
            f"this holds for each of the {findings.lenses} lenses of the plate by itself; its land and "
            "its neighbours are not looked at"
        )
    for surface in findings.surfaces:
        lines.append(_fit_line(findings.order, surface))
        lines += _cusp_lines(findings.order, surface)
        lines += _motion_lines(findings.order, surface)
    return [*lines, *_draft_lines(findings)]


def tool_data(findings: ToolFindings) -> dict[str, Any]:
    """Return what was found as plain data for JSON; an infinite or unknown number is None."""
    order = findings.order
    asked = {
        "ball_mm": order.ball,
        "nose_mm": order.nose,
        "step_mm": order.step,
        "feed_mm": order.feed,
        "rows": order.rows,
        "rpm": order.rpm,
        "acceleration_m_s2": order.acceleration,
        "speed_mm_min": order.speed,
    }
    surfaces = {s.name: _surface_data(order, s) for s in findings.surfaces}
    walls = {w.name: {"measured": w.angle, "x": w.x, "y": w.y} for w in findings.draft.walls}
    return {
        "order": asked,
        "surfaces": surfaces,
        "draft": {
            "front_degrees": bound_data(findings.draft.front),
            "rear_degrees": bound_data(findings.draft.rear),
            "walls_degrees": walls,
            "body_degrees": findings.body_draft,
        },
        "lenses": findings.lenses,
    }


def _fit_line(order: ToolOrder, surface: SurfaceFindings) -> str:
    least, what = surface.fit.least, "of sections through the axis " if order.spiral else ""
    verdict = VERDICTS[fit_word(surface.fit)].format(tool=order.words, name=surface.name)
    if not isfinite(least.lower):
        return f"{verdict}: nothing is concave"
    where = f", {position(least)}" if isfinite(least.value) else ""
    return (
        f"{verdict}: the least concave radius {what}lies between {least.lower:.6g} and {least.upper:.6g} mm"
        f"{where}"
    )


def fit_word(fit: Fit) -> str:
    """Return "fits", "does not fit" or "undecided"."""
    return "fits" if fit.proven else "does not fit" if fit.refuted else "undecided"


def _cusp_lines(order: ToolOrder, surface: SurfaceFindings) -> Iterator[str]:
    blur, pitch = surface.blur, surface.pitch
    if blur is None or pitch is None:
        sentence = "are unknown: no light for the target crosses it where the tool fits"
        yield f"cusps on the {surface.name} {sentence}"
        return
    worst, x, y = blur.worst()
    anywhere = surface.height_anywhere * pitch**2
    path = f"a feed of {pitch:.4g} mm" if order.spiral else f"rows along {order.rows}, {pitch:.4g} mm apart"
    yield (
        f"cusps of {path} on the {surface.name} are up to {surface.cusp_height * NM:.3g} nm high where light "
        f"for the target crosses it, and up to {anywhere * NM:.3g} nm anywhere on it; "
        f"they blur the light by up to {worst * pitch:.3g} pixels (rms {blur.rms * pitch:.3g}), most at "
        f"x = {x:.4g}, y = {y:.4g} mm"
    )
    what = "feed" if order.spiral else "step"
    yield (
        f"the largest {what} on the {surface.name} that blurs by {_yardstick(surface)} at most is "
        f"{surface.largest_pitch:.4g} mm"
    )
    yield _polish_line(order, surface)
    yield from _row_lines(order, surface)
    if surface.light is not None:
        yield (
            f"with these cusps rel_l2 of the picture is {surface.light.with_cusps:.4f}, without them "
            f"{surface.light.without:.4f}"
        )
    if blur.unknown:
        yield (
            f"{blur.unknown:.2%} of the light crosses places of the {surface.name} where the tool does not "
            "fit; they are left out of the blur"
        )


def _yardstick(surface: SurfaceFindings) -> str:
    if surface.yardstick == 1:
        return "one pixel"
    return f"{surface.yardstick:.3g} pixels, half of the blur that there is without cusps,"


def _polish_line(order: ToolOrder, surface: SurfaceFindings) -> str:
    """Return whether the light asks for polishing, and why."""
    assert surface.blur is not None  # cusps are known
    assert surface.pitch is not None
    blurred = f"by {surface.blur.worst()[0] * surface.pitch:.3g} pixels"
    yardstick = _yardstick(surface).rstrip(",")
    what = "feed" if order.spiral else "step"
    if surface.light is not None and surface.rise > RISE and surface.pitch <= (surface.largest_pitch or 0.0):
        finer = ""
        if surface.finer is not None:
            pitch, rise = surface.finer
            finer = f"; those of --{what} {pitch:g} raise it by {rise:.4f}"
        return (
            f"the {surface.name} must be polished, or cut with a smaller {what}: its cusps raise rel_l2 from "
            f"{surface.light.without:.4f} to {surface.light.with_cusps:.4f}, by more than {RISE:g}, although "
            f"they blur the light only {blurred}{finer}"
        )
    if surface.polish:
        return (
            f"the {surface.name} must be polished, or cut with the largest {what}: its cusps blur the light "
            f"{blurred}, more than {yardstick}"
        )
    return (
        f"the {surface.name} needs no polishing for this light: its cusps blur it {blurred} at most, and the "
        f"yardstick is {yardstick}"
    )


def _row_lines(order: ToolOrder, surface: SurfaceFindings) -> Iterator[str]:
    """Yield what it takes to cut with a ball, and what to do where that is long."""
    cut = surface.rows
    if cut is None:
        return
    speed = order.speed or SPEED
    default = "" if order.speed else ", as nothing else is said (--speed)"
    yield (
        f"one pass over the {surface.name} is {cut.rows:,} rows, {cut.length:,.0f} m of cutting, and "
        f"takes {cut.hours:.3g} hours at {speed:g} mm for each minute{default}; turns between rows, roughing "
        "and polishing are not in them"
    )
    if cut.hours > LONG:
        larger = surface.fit.least.lower
        yield (
            f"rows become fewer in proportion to the radius of the ball, of which up to {larger:.3g} mm fit"
            if larger > ENOUGH * surface.fit.tool
            else "a lens that is polished may be cut in coarser rows: the form that polishing leaves counts "
            "then (thbcad tolerance)"
        )


def _motion_lines(order: ToolOrder, surface: SurfaceFindings) -> Iterator[str]:
    if not order.spiral:
        return
    motion = surface.motion
    if motion is None:
        yield f"how a tool turns the {surface.name} is unknown: it is not proven to fit"
        return
    beside, gaps = "", motion.gaps
    if gaps is not None:
        worst, x, y = gaps.worst()
        beside = f", and by {worst:.5g} mm beside it, at x = {x:.4g}, y = {y:.4g} mm (sampled)"
    yield (
        f"the tool on the {surface.name} accelerates by up to {motion.kernel.upper:.5g} mm times the square "
        f"of the angular speed over the lens, most {position(motion.kernel)} (certified){beside}"
    )
    if gaps is not None:
        yield (
            f"beside the lens, up to the corners' radius of {motion.cut.radius:.4g} mm, the tool follows "
            f"{EXTENSION}; there its height goes from {gaps.t.min():.4g} to {gaps.t.max():.4g} mm"
        )
    yield (
        f"the clearance angle behind the edge must be at least {motion.clearance.upper:.4g} degrees, "
        f"{position(motion.clearance)}"
    )
    rpm = order.rpm
    if order.acceleration is not None:
        highest = motion.highest_rpm(order.acceleration)
        most = f"at most {highest:.4g}" if isfinite(highest) else "any number of"
        yield f"{order.acceleration:g} m/s^2 allow {most} revolutions for each minute"
        rpm = highest if rpm is None else rpm
    if rpm is not None and isfinite(rpm):
        yield (
            f"at {rpm:.4g} revolutions for each minute the tool accelerates by up to "
            f"{motion.acceleration(rpm):.4g} m/s^2; one pass of {motion.cut.turns:.5g} turns, "
            f"{motion.cut.length:.4g} m long, takes {motion.cut.hours(rpm):.4g} hours"
        )
    else:
        yield (
            f"one pass has {motion.cut.turns:.5g} turns and is {motion.cut.length:.4g} m long; --rpm or "
            "--acceleration tell its hours"
        )


def _draft_lines(findings: ToolFindings) -> Iterator[str]:
    draft = findings.draft
    for name, face in (("front", draft.front), ("rear", draft.rear)):
        where = "" if face.value == 90 else f", {position(face)}"
        yield f"the draft angle of the {name} against z is at least {face.lower:.4g} degrees{where}"
    if findings.body_draft is not None:
        yield f"the walls of the body have a draft of {findings.body_draft:g} degrees, as lens.body asks for"
    if not draft.walls:
        return
    least = min(draft.walls, key=lambda wall: wall.angle)
    if least.angle:
        yield f"the draft angle of the walls is at least {least.angle:.4g} degrees, on {least.name}"
    else:
        yield f"the walls have no draft: {least.name} is parallel to z; make one of the rims smaller"


def _surface_data(order: ToolOrder, surface: SurfaceFindings) -> dict[str, Any]:
    blur, pitch = surface.blur, surface.pitch
    cusps = None
    if blur is not None and pitch is not None:
        worst, x, y = blur.worst()
        cusps = {
            "pitch_mm": pitch,
            "height_mm": surface.cusp_height,
            "blur_pixels": {"greatest": worst * pitch, "rms": blur.rms * pitch, "x": x, "y": y},
            "height_anywhere_mm": surface.height_anywhere * pitch**2,
            "one_pixel_mm": 1 / worst,
            "yardstick_pixels": surface.yardstick,
            "largest_mm": surface.largest_pitch,
            "polish": {"needed": surface.polish, "why": _polish_line(order, surface)},
            "left_out": blur.unknown,
            "rel_l2": None
            if surface.light is None
            else {"with": surface.light.with_cusps, "without": surface.light.without},
        }
    return {
        "fit": fit_word(surface.fit),
        "least_concave_radius_mm": bound_data(surface.fit.least),
        "cusps": cusps,
        "rows": None if surface.rows is None else _rows_data(order, surface.rows),
        "spiral": None if surface.motion is None else _motion_data(order, surface.motion),
    }


def _rows_data(order: ToolOrder, cut: RowCut) -> dict[str, float]:
    return {
        "rows": cut.rows,
        "length_m": cut.length,
        "speed_mm_min": order.speed or SPEED,
        "hours": cut.hours,
    }


def _motion_data(order: ToolOrder, motion: SpiralMotion) -> dict[str, Any]:
    rpm = order.rpm
    highest = None if order.acceleration is None else motion.highest_rpm(order.acceleration)
    if rpm is None and highest is not None and isfinite(highest):
        rpm = highest
    return {
        "radius_mm": motion.cut.radius,
        "turns": motion.cut.turns,
        "length_m": motion.cut.length,
        "acceleration_over_omega2_mm": bound_data(motion.kernel),
        **({} if motion.gaps is None else {"beside_the_lens": _beside(motion.gaps)}),
        "clearance_degrees": bound_data(motion.clearance),
        "rpm": rpm,
        "highest_rpm": highest if highest is None or isfinite(highest) else None,
        "acceleration_m_s2": None if rpm is None else motion.acceleration(rpm),
        "hours": None if rpm is None else motion.cut.hours(rpm),
    }


def _beside(gaps: Gaps) -> dict[str, Any]:
    worst, x, y = gaps.worst()
    return {
        "extension": EXTENSION,
        "acceleration_over_omega2_mm": {"measured": worst, "x": x, "y": y},
        "height_mm": [float(gaps.t.min()), float(gaps.t.max())],
    }
