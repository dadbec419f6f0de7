"""What a missed limit of manufacturing asks of the problem: got, wanted, remedy."""

from __future__ import annotations

from math import ceil, floor, log10
from typing import TYPE_CHECKING

from optics.problem.manufacturing_limits import limit_misses
from thbcad.lens import mass

if TYPE_CHECKING:
    from optics.problem.manufacturing_limits import Miss
    from optics.problem.problem_record import Problem
    from thbcad.lens import Manufacturability

DIGITS = 4  # of the limit that would be kept


def limit_sentences(problem: Problem, metrics: Manufacturability) -> list[str]:
    """Return a sentence for every limit that the lens may miss, the certified number against the limit."""
    sentences = []
    for m in limit_misses(problem, metrics):
        if m.most > 0:
            wanted = f"wanted at {'most' if m.beyond else 'least'} {m.wanted:g} {m.unit}"
            allowed = f"allow limits.{m.key} = {_allowed(problem, m)}"
            remedy = _remedy(problem, metrics, m)
            sentences.append(
                f"{m.quantity}: got {m.got:.4g} {m.unit}, {wanted}{m.where}: {remedy}, or {allowed}"
            )
    return sentences


def _remedy(problem: Problem, metrics: Manufacturability, miss: Miss) -> str:
    """Return the setting that helps most."""
    change = f"lens.thickness by {_rounded(miss.most, True):g} mm, or z_freedom of the free surfaces"
    distance = f"raise target.distance or lens.{miss.surface}.freeform.z_freedom"
    bent = distance if miss.surface in problem.lens.free else f"change lens.{miss.surface}.radius"
    if miss.key in ("radius", "concave_radius", "feature"):
        return _flatter(problem, miss) or _coarser(metrics, miss.surface)
    if miss.key == "mass":
        x, y = problem.lens.rear.half_width
        per_mm = mass(4 * x * y, problem.lens.density)
        return f"lower lens.thickness by about {miss.most / per_mm:.2g} mm"
    if miss.key in ("slope", "sag_range") or miss.surface == "front":
        return bent
    if miss.beyond:
        return f"lower {change.replace(', or ', ', or raise ')}"
    return f"raise {change}"


def _flatter(problem: Problem, miss: Miss) -> str:
    """Return the setting of a conic that is itself too curved, or ""."""
    radius = getattr(problem.lens, miss.surface).radius
    hollow = radius > 0 if miss.surface == "rear" else radius < 0
    if miss.key == "feature" or abs(radius) >= miss.wanted or (miss.key == "concave_radius" and not hollow):
        return ""
    conic = f"lens.{miss.surface}.radius = {'-' if radius < 0 else ''}{miss.wanted:g}"
    return f"set {conic}, or raise lens.{miss.surface}.freeform.z_freedom"


def _coarser(metrics: Manufacturability, surface: str) -> str:
    """Return the setting of a mesh that is coarser by a level, or by fewer spans."""
    feature = metrics.surfaces[surface].feature
    assert feature is not None, "these limits hold for free surfaces"
    if feature.level:
        return f"set lens.{surface}.freeform.max_level = {feature.level - 1}"
    return f"take fewer lens.{surface}.freeform.spans"


def _allowed(problem: Problem, miss: Miss) -> str:
    """Return the limit that the lens keeps, as text for the problem file."""
    number = f"{_rounded(miss.got, miss.beyond):g}"
    if miss.key != "envelope":
        return number
    low, high = problem.limits.envelope
    return f"[{number}, {high:g}]" if miss.surface == "front" else f"[{low:g}, {number}]"


def _rounded(number: float, up: bool) -> float:
    """Return a number rounded to DIGITS digits, up or down."""
    if not number:
        return 0.0
    unit = 10.0 ** (floor(log10(abs(number))) + 1 - DIGITS)
    return (ceil(number / unit) if up else floor(number / unit)) * unit
