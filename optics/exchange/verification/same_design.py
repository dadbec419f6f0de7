"""Whether a lens is that of a problem, number by number, and the text of a STEP file that of a fresh export:
the same solid and the same words, however written.

Two texts hold the same solid where their faces and edges agree bit for bit, whatever the numbers of the
entities, their order, the lines and the comments, and whichever program printed them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from math import isinf

import numpy as np

from optics.base.runtime import Check
from optics.exchange.verification.step_file import StepFile
from optics.scene.problem import Freeform, Front, Problem, Rear, base_of
from optics.scene.system import MadePart
from thbcad.cad.exchange import step_bytes
from thbcad.checks import Floats
from thbcad.io import Brep, BrepCurve, BrepEdge, BrepFace, brep_of_text
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import ConicCurve
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface

UNIFORM = "distance of knots from uniform ones"
BOUND = 1e-12  # relative: rounding of coefficients that lie on z_freedom

Pair = tuple[str, float, float, str]  # a key, its value in the problem and in the lens, the unit


def prescription_checks(problem: Problem, lens: Lens, given: bool = False) -> list[Check]:
    """Return a Check that the lens is what the problem asks for, or one for every key that is another.

    Compared are index, thickness, half-widths, radii, conic constants, degrees and spans; the sags must keep
    to z_freedom.  Of source and target a lens says nothing.

    problem : resolved, as in a result folder.  given : the lens was there before, and has knots of its own
    """
    different = [pair for pair in _pairs(problem, lens) if pair[1] != pair[2]]
    if given:
        different = [pair for pair in different if not pair[0].startswith(UNIFORM)]
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
            yield f"{UNIFORM} by {name}.spans in {axis}", 0.0, off, "mm"
    greatest = float(abs(sag.coefficients).max())
    bound = freeform.freedom
    yield f"{name}.z_freedom", bound, greatest if greatest > (1 + BOUND) * bound else bound, "mm"


OTHER_TEXT = (
    "the text of the STEP file differs from a fresh export of the lens by this version; "
    "every number of the solid and every name agrees"
)


def fresh_export_checks(part: MadePart, schema: str, file: StepFile) -> tuple[list[Check], list[str]]:
    """Return the Checks of the solid and the words of a file against a fresh export of an element, and a note
    where the texts differ all the same.

    Raises OSError : the file cannot be read.  ValueError : it is not whole, or not one solid.
    """
    fresh = step_bytes(part.made, part.product, schema)
    if file.path.read_bytes() == fresh:
        return same_checks(file.text, file.text), []
    checks = same_checks(file.text, brep_of_text(fresh.decode("latin-1")))
    return checks, [OTHER_TEXT] if all(check.ok for check in checks) else []


def same_checks(solid: Brep, fresh: Brep) -> list[Check]:
    """Return the Checks of a solid and its words against those of a fresh export."""
    mine, wanted = (Counter[Hashable](),) * 2 if solid is fresh else (_parts(solid), _parts(fresh))
    parts = max((mine - wanted).total(), (wanted - mine).total())
    words = [label for label, texts in fresh.labels.items() if solid.labels[label] != texts]
    which = f" ({', '.join(words)})" if words else ""
    return [
        Check.none_of("text of the file: faces and edges that differ from a fresh export of the lens", parts),
        Check.none_of(f"text of the file: words that are not those of the problem{which}", len(words)),
    ]


def _parts(solid: Brep) -> Counter[Hashable]:
    """Return the faces and edges of a solid as values that are equal where every number is."""
    carriers = {face.carrier: _carrier(face) for face in solid.faces}
    edges = {edge.number: _edge(edge, carriers) for edge in solid.edges}
    # a loop has no first edge, a face no first loop
    faces = (
        (face.name, carriers[face.carrier], face.outward, frozenset(Counter(map(_turned, loops)).items()))
        for face in solid.faces
        for loops in [[[(edges[number], along) for number, along in loop] for loop in face.loops]]
    )
    return Counter[Hashable]([*faces, *edges.values()])


def _turned(loop: Sequence[Hashable]) -> Hashable:
    """Return a loop from its least edge on."""
    if not loop:
        return ()
    order = [hash(use) for use in loop]
    first = order.index(min(order))
    return (*loop[first:], *loop[:first])


def _carrier(face: BrepFace) -> Hashable:
    """Return the surface under a face as a value."""
    surface = face.surface
    if surface is None:
        swept = face.extrusion
        drawn = None if swept is None else (_curve(swept.curve), bits_of(swept.vector))
        return face.surface_type, *map(bits_of, (face.plane, face.sphere, face.cylinder, face.cone)), drawn
    net = surface.coefficients if isinstance(surface, BSplineSurface) else surface.homogeneous.coefficients
    return face.surface_type, _knots(surface.kv_u), _knots(surface.kv_v), net.shape, bits_of(net)


def same_surface(face: BrepFace, other: BrepFace) -> bool:
    """Return whether the surfaces under two faces agree, bit for bit."""
    return _carrier(face) == _carrier(other)


def _edge(edge: BrepEdge, carriers: dict[int, Hashable]) -> Hashable:
    """Return an edge and its images as a value."""
    images = Counter((carriers.get(image.carrier), _curve(image)) for image in edge.images)
    return bits_of(edge.ends), _curve(edge), frozenset(images.items())


def _curve(curve: BrepCurve) -> Hashable:
    drawn = None if curve.conic is None else conic_bits(curve.conic)
    return _knots(curve.kv), bits_of(curve.poles), bits_of(curve.weights), drawn


def conic_bits(conic: ConicCurve) -> Hashable:
    """Return a conic as a value."""
    return conic.kind, bits_of(conic.placement), bits_of(conic.sizes)


def _knots(kv: KnotVector | None) -> Hashable:
    return None if kv is None else (kv.degree, bits_of(kv.knots))


def bits_of(array: Floats | None) -> bytes | None:
    """Return a row's bytes; 0.0 and -0.0 are the same number."""
    return None if array is None else np.ascontiguousarray(array + 0.0).tobytes()
