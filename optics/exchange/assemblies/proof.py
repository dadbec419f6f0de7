"""Checks of a STEP file that holds a lens with its mount against the lens in memory; a placement may move its
one solid.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from optics.base.runtime import Check, reading
from optics.exchange.assemblies.light_checks import ELSEWHERE, UNKNOWN, light_checks
from optics.exchange.assemblies.light_proof import PartLight
from optics.exchange.verification import (
    FileFace,
    RaysBehind,
    occt_through,
    optiland_through,
    same_surface,
    state_checks,
    through_faces,
    whole_checks,
)
from optics.light.tracing import LandingPoints
from optics.scene.receivers import receiver_at
from optics.scene.system import System
from thbcad.cad.exchange import SolidState, step_bytes, step_shape
from thbcad.cad.parts import (
    PlacedLens,
    edge_deviation,
    face_deviation,
    placed_lens,
    projected_area,
    surface_numbers,
)
from thbcad.certified import DIRECTIONS
from thbcad.checks import Floats
from thbcad.io import (
    Brep,
    Entities,
    Entity,
    Value,
    brep,
    brep_of_text,
    direction_of,
    entity_of,
    having,
    points_of,
    read_file,
)
from thbcad.lens import LENS_SIDES, MIRROR_SIDES, Lens, optical_forms

PLACEMENT = "ITEM_DEFINED_TRANSFORMATION"
TOLERANCE = 1e-6  # mm, as of a lens by itself
# mm, of edges at which OCCT cuts a mount, slanted edges of a lens, or front and rear: bores through a
# designed rear are off by up to 0.7 um, where the light is proven or traced all the same
OTHER_EDGES = 1e-3
TRIM = 1e-7  # mm, of the edges of front and rear and of their images in the parameters
SURFACE = 1e-10  # mm; conics as splines are within 1e-11 mm
AREA = 1e-9  # relative: rims are straight in x and y, and rounding is all that is left
MOTION = 1e-12  # rounding of two rotations
RAYS = (21, 22)  # in x and y: numbers without a ray on the axes of symmetry of both
WITHIN = 0.98  # of the half-widths: rays that meet the front
SOURCE = np.array([0.1, 0.2, -5.0])  # in widths of the front: light that meets it aslant
BEFORE = 0.1  # mm before the front, where rays start: what a mount shades is not asked
DISTANCE = 100.0  # mm behind the rear, a usual distance of a target
LANDING = 1e-8  # mm


class PlacedText(NamedTuple):
    """A solid in its own frame, and the motion of that frame: a rotation beside a shift, (3, 4) float."""

    solid: Brep
    motion: Floats


def placed_text(path: str | Path) -> PlacedText:
    """Read the one solid of a STEP file, and its placement where it has one, from the text.

    Raises OSError : the file cannot be read.
    Raises ValueError : as `parse_brep`, but for one placement.
    """
    header, entities = read_file(path)
    try:
        placements = having(entities, PLACEMENT)
        if len(placements) > 1:
            raise ValueError(f"the file must place its one part once, got {len(placements)} placements")
        placing = {entity.number for entity in placements}
        rest = Entities({number: text for number, text in entities.texts.items() if number not in placing})
        motion = _motion(entities, placements[0]) if placements else np.eye(4)[:3]
        return PlacedText(brep(rest, header), motion)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _motion(entities: Entities, placement: Entity) -> Floats:
    """Return the motion T of a placement from the frame F to the frame G, T = G F^-1."""
    _, _, start, stop = placement.parameters(PLACEMENT, 4)
    frames = [_frame(entities, item, placement) for item in (start, stop)]
    return (frames[1] @ np.linalg.inv(frames[0]))[:3]


def _frame(entities: Entities, item: Value, user: Entity) -> Floats:
    """Return an AXIS2_PLACEMENT_3D as a matrix (4, 4)."""
    axes = entity_of(entities, item, user)
    _, point, axis, first = axes.parameters("AXIS2_PLACEMENT_3D", 4)
    z, x = (direction_of(entities, direction, axes) for direction in (axis, first))
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3] = np.column_stack([x, np.cross(z, x), z, points_of(entities, [point], axes)[0]])
    return frame


def part_checks(
    path: Path, lens: Lens, by_optiland: bool, system: System | None = None
) -> tuple[list[Check], list[str]]:
    """Return the Checks of a part with a lens, by its text, by OCCT and in its light, and what is left out.

    system : whose light the lens shapes; None is not known.  That of a lens on the axis is followed; of one
        that lies elsewhere, or before other elements, it is left out.

    Raises UserError : the file cannot be read, is not whole, or not one solid.
    """
    unknown = UNKNOWN
    if system is not None and not system.lens_on_axis:
        system, unknown = None, ELSEWHERE
    with reading(path):
        text = placed_text(path)  # first the reader that damaged files cannot crash
        shape = step_shape(path)
    checks, left_out = whole_checks(text.solid, OTHER_EDGES)
    checks += _text_checks(text, lens)
    state = SolidState(shape)
    checks += state_checks(state, "by OCCT")
    try:
        placed = placed_lens(shape, lens)
    except ValueError as error:
        checks.append(Check.none_of(f"front and rear of the lens in the part, by OCCT: {error}", 1))
        return checks, left_out
    apart = float(np.abs(placed.matrix - text.motion).max())
    checks.append(Check("placement by OCCT against that in the text of the file", apart, MOTION, ""))
    # how far the areas of front and rear are from those of the lens, relative
    back = placed.placement.Inverted()
    off = {}
    for name, surface, _ in lens.faces:
        area = projected_area(placed.faces[name].Moved(back))
        off[name] = abs(area / surface.outline.area - 1)
    trimmed = max(off.values()) > AREA
    most = OTHER_EDGES if trimmed else TOLERANCE
    checks.append(Check("tolerance that faces, edges and vertices need to meet", state.tolerance, most, "mm"))
    checks += _face_checks(placed, lens, OTHER_EDGES if trimmed else TRIM)
    if system is None:
        checks += [
            Check(f"area of the {name} that the part covers or cuts, relative", value, AREA, "")
            for name, value in off.items()
        ]
    part = PartLight(placed.in_lens_frame(), placed.numbers, lens, system)
    of_light, words = light_checks(part, unknown)
    return [*checks, *of_light, *landing_checks(placed, part, by_optiland)], left_out + words


def _text_checks(text: PlacedText, lens: Lens) -> list[Check]:
    """Return the Checks that the text holds the surfaces of front and rear, or of a mirror's face and back,
    number by number, once each."""
    fresh = {face.name: face for face in brep_of_text(step_bytes(lens).decode("latin-1")).faces}
    mirror = any(face.name in MIRROR_SIDES for face in text.solid.faces)
    checks = []
    for side, name in zip(LENS_SIDES, MIRROR_SIDES if mirror else LENS_SIDES):
        named = [face for face in text.solid.faces if face.name == name]
        off = abs(len(named) - 1) + sum(not same_surface(face, fresh[side]) for face in named)
        checks.append(
            Check.none_of(f"text of the file: faces named {name} that are not the {name} of the lens", off)
        )
    rotation = text.motion[:, :3]
    mirrored = abs(np.linalg.det(rotation) - 1)
    off_rotation = max(float(np.abs(rotation @ rotation.T - np.eye(3)).max()), float(mirrored))
    checks.append(Check("text of the file: placement that is no rotation", off_rotation, MOTION, ""))
    return checks


def _face_checks(placed: PlacedLens, lens: Lens, trim: float) -> list[Check]:
    """Return the Checks of the numbers, the points and the edges of front and rear.

    trim : mm, that their edges may miss them by.
    """
    checks = []
    for name, surface, vertex in lens.faces:
        geometry = placed.geometry(name)
        differing = surface_numbers(geometry).differing(surface_numbers(placed.surfaces[name]))
        deviation = face_deviation(geometry, surface, vertex)
        edges = edge_deviation(placed.faces[name])
        checks += [
            Check.none_of(f"{name} numbers that differ from the lens in memory, by OCCT", differing),
            Check(f"{name} face against the lens in memory, by OCCT", deviation, SURFACE, "mm"),
            Check(f"edges of the {name} and their images, by OCCT", edges, trim, "mm"),
        ]
    return checks


def landing_checks(placed: PlacedLens, part: PartLight, by_optiland: bool) -> list[Check]:
    """Return the Checks of the landing points of rays through the faces of a part against those through the
    lens in memory.

    Rays like those of the source are traced by OCCT's intersections with all faces of the part, and by
    optiland where it is wanted; the lens in memory by scipy.  Their fates count where the light is proven to
    be free: elsewhere trims may stop rays that are none of the light.
    """
    rays, index = _rays(part), part.lens.index
    target = receiver_at(part.lens.thickness + DISTANCE)
    front, rear = optical_forms(part.lens)
    wanted = through_faces([FileFace(front, 1 / index), FileFace(rear, index)], rays).landing(target)
    crossed = [(0, 1 / index), (1, index)]
    programs = {"OCCT's intersections": occt_through(part.solid, part.optical, rays, crossed)}
    if by_optiland:
        programs["optiland's trace"] = optiland_through(*placed.forms, rays, index)
    return [
        check
        for name, behind in programs.items()
        for check in _compared(name, behind.landing(target), wanted, part.proven)
    ]


def _rays(part: PartLight) -> RaysBehind:
    """Return rays of 1 W from a little before the lit part of the front: parallel to z, from the middle of
    the source, or from a point where that is not known."""
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
    return RaysBehind(points - BEFORE * onward, onward, np.ones(len(points)))


def _compared(name: str, found: LandingPoints, wanted: LandingPoints, by_fate: bool) -> list[Check]:
    lit = [points.flux > 0 for points in (found, wanted)]
    both = lit[0] & lit[1]
    error = float(np.abs(found.points[both] - wanted.points[both]).max()) if both.any() else np.inf
    landing = Check(f"landing points by {name} with the part", error, LANDING, "mm")
    other = Check.none_of(f"rays with another fate by {name} with the part", (lit[0] != lit[1]).sum())
    return [other, landing] if by_fate else [landing]
