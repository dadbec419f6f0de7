"""Whether a lens is that of a problem: what both say of it, compared number by number."""

from __future__ import annotations

from collections.abc import Iterator
from math import isinf

from optics.base.runtime import Check
from optics.scene.problem import Freeform, Front, Problem, Rear, base_of
from thbcad.lens import FreeformSurface, Lens
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

BOUND = 1e-12  # relative: rounding of coefficients that lie on z_freedom

Pair = tuple[str, float, float, str]  # a key, its value in the problem and in the lens, the unit


def prescription_checks(problem: Problem, lens: Lens) -> list[Check]:
    """Return a Check that the lens is what the problem asks for, or one for every key that is another.

    Compared are index, thickness, half-widths, radii, conic constants, degrees and spans; the sags must keep
    to z_freedom.  Of source and target a lens says nothing.

    problem : resolved, as in a result folder.
    """
    different = [pair for pair in _pairs(problem, lens) if pair[1] != pair[2]]
    if not different:
        return [Check.none_of("keys of problem.toml that lens.json contradicts", 0)]
    return [
        Check(
            f"{key} is {asked:.10g} in problem.toml and {found:.10g} in lens.json",
            abs(asked - found),
            0,
            unit,
        )
        for key, asked, found, unit in different
    ]


def _pairs(problem: Problem, lens: Lens) -> Iterator[Pair]:
    spec = problem.optic
    yield spec.key("index"), spec.known_index, lens.index, ""
    yield spec.key("thickness"), spec.thickness, lens.thickness, "mm"
    yield from _surface(spec.key("front"), spec.front, lens.front)
    yield from _surface(spec.key("rear"), spec.rear, lens.rear)


def _surface(name: str, spec: Front | Rear, surface: FreeformSurface) -> Iterator[Pair]:
    for axis, asked, found in zip("xy", spec.half_width, surface.half_width):
        yield f"{name}.half_width in {axis}", asked, found, "mm"
    radius, conic = base_of(spec)
    if not (isinf(radius) and surface.conic.is_plane):
        yield f"{name}.radius", radius, surface.conic.radius, "mm"
    yield f"{name}.conic", conic, surface.conic.constant, ""
    free = (spec.freeform is not None, surface.sag is not None)
    yield f"number of free surfaces by {name}.freeform", float(free[0]), float(free[1]), ""
    if spec.freeform is not None and surface.sag is not None:
        yield from _sag(f"{name}.freeform", spec.freeform, surface)


def _sag(name: str, freeform: Freeform, surface: FreeformSurface) -> Iterator[Pair]:
    sag: THBSurface | None = surface.sag
    assert sag is not None
    kvs = sag.space.kv_u, sag.space.kv_v
    for axis, kv, spans, half in zip("xy", kvs, freeform.spans, surface.half_width):
        yield f"{name}.degree in {axis}", freeform.degree, kv.degree, ""
        yield f"{name}.spans in {axis}", spans, kv.spans, ""
        if (kv.degree, kv.spans) == (freeform.degree, spans):
            uniform = KnotVector.uniform(kv.degree, spans, -half, half)
            off = float(abs(kv.knots - uniform.knots).max())
            yield f"distance of knots from uniform ones by {name}.spans in {axis}", 0.0, off, "mm"
    greatest = float(abs(sag.coefficients).max())
    bound = freeform.freedom
    yield f"{name}.z_freedom", bound, greatest if greatest > (1 + BOUND) * bound else bound, "mm"
