"""What missed limits of manufacturing ask of the problem: got, wanted, and one remedy for each cause.

A remedy is an option `--set KEY=VALUE` to copy.  Limits that ask for the same key share one, with the value
that serves all of them.  Where some ask for a thicker lens and others for a thinner one, no thickness serves:
the surfaces must be flatter by

    f = h / (h - a - b),        h = greatest - least thickness,

with the millimetres a that lack and b that are too many.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from math import ceil, floor, inf, isinf, log10, radians, tan

from optics.scene.limits.misses import Miss, limit_misses
from optics.scene.problem import Optic, Problem
from thbcad.lens import FreeformSurface, Lens, Manufacturability, mass

DIGITS = 4  # of the numbers in a remedy
KEPT_THICKNESS = 0.05  # of the thickness: the least that a design keeps where the surfaces could cross
LEAST_HEIGHT = 0.1  # of the height of the surfaces: flatter ones could not send the light there


@dataclass(frozen=True)
class Wish:
    """A value that a key of the problem should have.

    cause : in words.  value : one number, or those of a list.  more : greater values serve as well, otherwise
    smaller ones.  allowed : the limit that the lens keeps as it is, as an option.
    """

    cause: str
    key: str
    value: list[float]
    more: bool
    allowed: str = ""


def limit_sentences(
    problem: Problem, metrics: Manufacturability, crossing: float = 0.0, element: str = ""
) -> list[str]:
    """Return a sentence for every remedy, with the limits that the lens may miss and that it serves.

    crossing : mm, by which surfaces crossed that the optimiser asked for.
    element : the name of the lens, where it is not the one that is designed.
    """
    wishes, of = [], element and f"{element}: "
    for miss in limit_misses(problem, metrics):
        if miss.most > 0:
            wanted = f"wanted at {'most' if miss.beyond else 'least'} {miss.wanted:g} {miss.unit}"
            cause = f"{of}{miss.quantity}: got {_got(miss)} {miss.unit}, {wanted}{miss.where}"
            kept = f"limits.{miss.key}={_allowed(problem, miss)}"
            wishes.append(Wish(cause, *_setting(problem, metrics, miss), kept))
    if crossing:
        thicker = _rounded((problem.optic.thickness + crossing) / (1 - KEPT_THICKNESS), True)
        cause = f"{of}the surfaces that the optimiser asks for cross by {crossing:.3g} mm"
        wishes.append(Wish(cause, problem.optic.key("thickness"), [thicker], True))
    wishes, given_up = _without_conflict(problem, metrics, wishes)
    sentences = []
    for key in dict.fromkeys(w.key for w in wishes):
        same = [w for w in wishes if w.key == key]
        numbers = ", ".join(f"{v:g}" for v in _best(same))
        option = f"{key}={numbers}" if len(same[0].value) == 1 else f"{key}=[{numbers}]"
        sentences.append(f"{'; '.join(w.cause for w in same)}: --set {shlex.quote(option)}")
    return sentences + [f"{w.cause}: --set {shlex.quote(w.allowed)}" for w in given_up]


def flatter(problem: Problem, factor: float) -> tuple[str, list[float], bool]:
    """Return (key, value, whether it is raised) of a target that slopes less steep by a factor reach.

    Slopes are about (X - x) / ((n - 1) D), with the distance D of the target; far away its angles count, and
    where its place is given its size.
    """
    if problem.target.distance is None or problem.target.far_field:
        return "target.half_width", [_rounded(h / factor, False) for h in problem.target.half_width], False
    return "target.distance", [_rounded(problem.target.distance * factor, True)], True


def _setting(problem: Problem, metrics: Manufacturability, miss: Miss) -> tuple[str, list[float], bool]:
    """Return key, value, and whether greater values serve as well."""
    lens, free = problem.optic, miss.surface in problem.optic.free
    if miss.key in ("radius", "concave_radius", "feature"):
        return _smoother(problem, metrics, miss)
    if miss.key in ("slope", "sag_range") or miss.surface == "front":
        got, wanted = miss.got, miss.wanted
        if miss.key == "slope":  # of a paraboloid tan(slope) = r / R, and others flatten faster
            got, wanted = tan(radians(got)), tan(radians(wanted))
        times = got / wanted if wanted else inf
        if free:
            return flatter(problem, times if 0 < times < inf else 2.0)
        radius = getattr(lens, miss.surface).radius * times
        return (
            lens.key(f"{miss.surface}.radius"),
            [_rounded(radius, radius > 0) if times > 0 else inf],
            radius > 0,
        )
    amount = miss.most
    if miss.key == "mass":
        amount /= mass(_volume_by_thickness(lens), lens.density)
    thickness = lens.thickness - amount if miss.beyond else lens.thickness + amount
    return lens.key("thickness"), [_rounded(thickness, not miss.beyond)], not miss.beyond


def _volume_by_thickness(optic: Optic) -> float:
    """Return dV/dt of what is made, mm^2: of plates that of all their lenses."""
    front, rear = (
        FreeformSurface(half, corners=optic.corners(half))
        for half in (optic.front.half_width, optic.rear.half_width)
    )
    count = 1 if optic.array is None else optic.array.count
    return count * Lens(front, rear, thickness=1.0, index=1.5).volume()


def _smoother(problem: Problem, metrics: Manufacturability, miss: Miss) -> tuple[str, list[float], bool]:
    """Return the setting of a conic that is itself too curved, or of a mesh coarser by a level, or
    by spans."""
    surface = problem.optic.key(miss.surface)
    radius = getattr(problem.optic, miss.surface).radius
    hollow = radius > 0 if miss.surface == "rear" else radius < 0
    if miss.key != "feature" and abs(radius) < miss.wanted and (hollow or miss.key == "radius"):
        return f"{surface}.radius", [-miss.wanted if radius < 0 else miss.wanted], radius > 0
    feature = metrics.surfaces[miss.surface].feature
    assert feature is not None, "these limits hold for free surfaces"
    if feature.level:
        return f"{surface}.freeform.max_level", [feature.level - 1], False
    share = miss.got / miss.wanted if miss.key == "feature" else 0.5
    spans = problem.optic.free[miss.surface].spans
    return f"{surface}.freeform.spans", [max(1, floor(n * share)) for n in spans], False


def _without_conflict(
    problem: Problem, metrics: Manufacturability, wishes: list[Wish]
) -> tuple[list[Wish], list[Wish]]:
    """Return the wishes with flatter surfaces where a thicker and a thinner lens are asked for, and those
    that no lens can fulfil beside the others: their limits must give way.
    """
    thickness = problem.optic.key("thickness")
    thicker, thinner = ([w for w in wishes if w.key == thickness and w.more is up] for up in (True, False))
    too_thin = thinner and _best(thinner)[0] <= 0
    if too_thin or (thinner and problem.optic.thickness - _best(thinner)[0] >= metrics.thickness.lower):
        return [w for w in wishes if w not in thinner], thinner
    if not (thicker and thinner):
        return wishes, []
    height = metrics.greatest_thickness.value - metrics.thickness.value
    left = height - (_best(thicker)[0] - _best(thinner)[0])
    if left <= LEAST_HEIGHT * height:
        return [w for w in wishes if w not in thinner], thinner
    key, value, more = flatter(problem, height / left)
    return [replace(w, key=key, value=value, more=more) if w.key == thickness else w for w in wishes], []


def _best(wishes: list[Wish]) -> list[float]:
    """Return the value that serves all wishes for a key, number by number."""
    best = max if wishes[0].more else min
    return [best(numbers) for numbers in zip(*(w.value for w in wishes), strict=True)]


def _got(miss: Miss) -> str:
    """Return the number that the limit would have to be, as text: what the lens keeps."""
    return f"{_rounded(miss.got, miss.beyond):g}"


def _allowed(problem: Problem, miss: Miss) -> str:
    """Return the limit that the lens keeps, as in a problem file."""
    if miss.key != "envelope":
        return _got(miss)
    low, high = problem.limits.envelope
    return f"[{_got(miss)}, {high:g}]" if miss.surface == "front" else f"[{low:g}, {_got(miss)}]"


def _rounded(number: float, up: bool) -> float:
    """Return a number rounded to DIGITS digits, up or down."""
    if not number or isinf(number):
        return number
    unit = 10.0 ** (floor(log10(abs(number))) + 1 - DIGITS)
    return (ceil(number / unit) if up else floor(number / unit)) * unit
