"""A scene as one STEP file: its elements where they lie, and source and screen as thin parts on request."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from optics.base.runtime import Check, UserError
from optics.exchange.verification import differing_numbers
from optics.scene.receivers import Plane
from optics.scene.system import System, scene_parts, source_frames
from thbcad.cad.exchange import (
    PlacedShape,
    conic_faces,
    part_of,
    product_of,
    read_scene,
    scene_step,
    sheet_part,
    spline_faces,
)
from thbcad.cad.shapes import Part
from thbcad.io import read_file, write_bytes
from thbcad.lens import FreeformSurface, Lens, Product
from thbcad.moulds import Plate
from thbcad.poses import Pose
from thbcad.sags import Conic
from thbcad.splines import BSplineSurface, KnotVector

Body: TypeAlias = tuple[Part, Product, Pose]

THIN = 0.1  # mm, of source and screen
POINT = 0.5  # mm, half the width of a source without extent
PLACED = 1e-11  # mm, of parts within a metre of the origin, and relative to that beyond
METRE = 1000.0
SPANS = 16  # of a curved screen in each direction


def export_scene(
    system: System, path: Path, staged: bool = False, files: Mapping[str, Path] = MappingProxyType({})
) -> list[Check]:
    """Write the elements of a scene as one assembly, and return its checks, as `scene_checks`.

    staged : with source and screen as thin parts.
    files : of the elements by name, where they are written already in the schema of the problem.

    Raises UserError : the body of an element cannot be made.
    """
    try:
        bodies = _bodies(system, staged)
        written = _assembled(system, bodies, files)
    except ValueError as error:
        raise UserError(f"cannot write the STEP file of the scene: {error}") from None
    write_bytes(path, written)
    return _checks(bodies, path)


def scene_text_check(system: System, path: Path, files: Mapping[str, Path]) -> Check:
    """Return the check that the file of a scene holds the very entities of the files of its elements.

    files : of all elements by name.

    Raises OSError : a file cannot be read.
    """
    wanted = _assembled(system, _bodies(system, staged=False), files)
    mine, theirs = (Counter(text.split(b";")) for text in (path.read_bytes(), wanted))
    off = max((mine - theirs).total(), (theirs - mine).total())
    return Check.none_of("scene: entities that differ from the files of its elements, in their places", off)


def _assembled(system: System, bodies: Sequence[Body], files: Mapping[str, Path]) -> bytes:
    parts = [
        (files[product.name].read_bytes() if product.name in files else part, product, pose)
        for part, product, pose in bodies
    ]
    return scene_step(parts, system.product, system.problem.export.schema)


def scene_checks(system: System, path: Path) -> list[Check]:
    """Return the Checks of names, places and numbers of the parts that OCCT reads in the file of a scene.

    Raises OSError : the file cannot be read.  ValueError : it is not whole, or no assembly.
    """
    read_file(path)  # a file that is cut off or damaged never reaches OCCT
    return _checks(_bodies(system, staged=False), path)


def _checks(bodies: Sequence[Body], path: Path) -> list[Check]:
    found, names = read_scene(path), [product.name for _, product, _ in bodies]
    checks = [Check.none_of("scene: parts that are not those named", [part.name for part in found] != names)]
    for part, (body, product, pose) in zip(found, bodies):
        checks += [_place_check(part, pose, product.name), _number_check(part, body, product.name)]
    return checks


def _bodies(system: System, staged: bool) -> list[Body]:
    bodies = [(part_of(p.made), product_of(p.made, p.product), p.pose) for p in scene_parts(system)]
    if not staged:
        return bodies
    made = system.made
    plate = made if isinstance(made, Plate) else None
    places = [(0.0, 0.0)] if plate is None else plate.places.tolist()
    x, y = (0.0, 0.0) if plate is None else plate.middle  # which faces the middle of the screen
    screen = [(part, product, Pose.at((x, y, 0.0)) @ pose) for part, product, pose in _screen(system)]
    return [*_sources(system, places), *bodies, *screen]


def _place_check(part: PlacedShape, pose: Pose, name: str) -> Check:
    """Return the check of how far a part lies from its place, at most, within a metre of its origin."""
    apart = METRE * np.linalg.norm(part.pose.rotation - pose.rotation, 2)
    off = float(apart + np.linalg.norm(part.pose.shift - pose.shift))
    limit = PLACED * max(1.0, float(np.linalg.norm(pose.shift)) / METRE)
    return Check(f"scene: distance of {name} from its place", off, limit, "mm")


def _number_check(part: PlacedShape, body: Part, name: str) -> Check:
    """Return the check of the numbers of all faces that are splines, or conics that light meets."""
    pairs = [[*spline_faces(shape), *conic_faces(shape)] for shape in (part.shape, body.solid)]
    off = sum(differing_numbers(*pair) for pair in zip(*pairs)) + abs(len(pairs[0]) - len(pairs[1]))
    return Check.none_of(f"scene: numbers of {name} that differ from those in memory", off)


def _sources(system: System, places: Sequence[Sequence[float]]) -> Iterator[Body]:
    """Yield every source as a thin plate, whose rear shines.

    places : x and y of the lenses, mm, each of which has all sources of the problem.
    """
    frames = [
        (source, Pose.at((x, y, 0.0)) @ pose)
        for x, y in places
        for source, pose in source_frames(system.problem)
    ]
    for number, (source, pose) in enumerate(frames, 1):
        half = source.half_width if min(source.half_width) > 0 else (POINT, POINT)
        corners = half if source.profile in ("round", "round_gaussian") else (0.0, 0.0)
        face = FreeformSurface(half, Conic(np.inf, 0.0), None, corners)
        plate = part_of(Lens(face, face, THIN, 1.5))
        name = "source" if len(frames) == 1 else f"source {number}"
        yield plate, Product(name), pose @ Pose.at((0.0, 0.0, -source.distance - THIN))


def _screen(system: System) -> list[Body]:
    """Return the screen as a sheet behind the light, none in the far field; a curved one is fitted."""
    receiver, half = system.target.receiver, system.target.settings.half_width
    if receiver.far_field:
        return []
    degree, spans = (1, 1) if isinstance(receiver, Plane) else (3, SPANS)
    kv_u, kv_v = (KnotVector.uniform(degree, spans, -h, h) for h in half)
    grid = np.meshgrid(kv_u.greville(), kv_v.greville(), indexing="ij")
    points = receiver.pose.inverse().points(np.stack(np.broadcast_arrays(*receiver.points(*grid))))
    through_u, through_v = (np.linalg.inv(kv.collocation(kv.greville()).toarray()) for kv in (kv_u, kv_v))
    sheet = BSplineSurface(kv_u, kv_v, np.einsum("ia,jb,kab->ijk", through_u, through_v, points))
    return [(sheet_part(sheet, THIN), Product("screen"), receiver.pose)]
