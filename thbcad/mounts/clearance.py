"""The proof that a mount leaves light its way: everything of it stays out of the clear aperture.

The clear aperture is the outline of the larger surface, and all of space before and behind it.  Holes, pins
and bosses stay beside it; the flange crosses it only within the glass, between the front and the rear.

The distance of a point p from a convex outline is the greatest d . p - h(d), h the support in the direction
d.  Every d gives a lower bound.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from math import hypot

import numpy as np

from thbcad.certified import value_range
from thbcad.checks import EPS, require_type
from thbcad.lens import Lens, require_sound, rim_gap, walls_of
from thbcad.mounts.records import LEAST, Mount, MountFlange
from thbcad.outlines import Outline

DIRECTIONS = 20_001  # of a quarter turn, 1e-8 of the distance from the middle of a corner apart
ROUNDINGS = 32  # of float64, more than there are operations from the numbers of a mount to a distance


@dataclass(frozen=True)
class Spot:
    """What a mount has at one place: a circle round (x, y) that holds all of it, mm."""

    word: str
    number: int
    x: float
    y: float
    radius: float

    def __str__(self) -> str:
        x, y = round(self.x, 6) + 0.0, round(self.y, 6) + 0.0  # no 1e-16 of a sine, no -0
        return f"{self.word} {self.number} at ({x:.6g}, {y:.6g}) mm"


@dataclass(frozen=True)
class MountProof:
    """What is proven of a mount on a lens.

    low, high : z of the faces of the flange, mm
    framed : whether the flange is a frame round the lens, instead of a plate through its glass
    clearance, wall : mm, lower bounds of the least distance from the clear aperture, and of the least wall;
        what is asked for may be missed by 1e-6 mm
    """

    low: float
    high: float
    framed: bool
    clearance: float
    wall: float


def require_mount(mount: Mount, lens: Lens) -> MountProof:
    """Return the MountProof of a mount on a lens.

    Raises ValueError : no Mount, no Lens, as `require_sound`; a flange that meets the front or the rear or is
        not wider than the lens; a hole, a pin or a boss that comes closer to the clear aperture than the
        clearance, or leaves less than the least wall; a gate that the flange does not carry.
    """
    require_type("mount", mount, Mount)
    low, high, framed = _seat(mount.flange, require_sound(lens))
    aperture = walls_of(lens, None)
    walls = [_require_wall(mount.flange.thickness, mount.wall, "as the thickness of the flange")]
    walls.append(_round_lens(mount, aperture))
    spots = list(spots_of(mount))
    gaps = [_beside(spot, aperture, mount.clearance) for spot in spots]
    walls += [_within(spot, mount) for spot in spots]
    walls += [_apart(a, b, mount.wall) for a, b in combinations(spots, 2)]
    walls += [
        _require_wall((post.diameter - post.bore) / 2, mount.wall, f"round the bore of a {post.word}")
        for post in mount.posts
        if post.bore
    ]
    for hole in mount.holes:
        if hole.sink > mount.flange.thickness:
            raise ValueError(
                f"a countersink of {hole.countersink:g} mm is {hole.sink:.6g} mm deep, more than the "
                f"flange's thickness of {mount.flange.thickness:g} mm; lower holes.countersink"
            )
    _require_gate(mount, aperture)
    return MountProof(low, high, framed, min(gaps, default=min(walls)), min(walls))


def spots_of(mount: Mount) -> Iterator[Spot]:
    """Yield the holes, the pins and the bosses of a mount, counted from 1 each."""
    kinds = [("hole", hole.places.points("holes"), hole.radius) for hole in mount.holes]
    kinds += [(post.word, post.places.points(post.word), post.diameter / 2) for post in mount.posts]
    count = {"hole": 0, "pin": 0, "boss": 0}
    for word, places, radius in kinds:
        for x, y in places:
            count[word] += 1
            yield Spot(word, count[word], x, y, radius)


def _seat(flange: MountFlange, lens: Lens) -> tuple[float, float, bool]:
    """Return low and high of the flange and whether it must be a frame; both faces are certified to stay
    between front and rear, or between their rims."""
    low, high, flush = _levels(flange, lens)
    front, rear = lens.graphs()
    shapes = lens.front.outline, lens.rear.outline
    top = value_range(front, outline=shapes[0])[1].upper if flush != "front" else -float("inf")
    bottom = (
        lens.thickness + value_range(rear, outline=shapes[1])[0].lower if flush != "rear" else float("inf")
    )
    if low >= top + LEAST and high <= bottom - LEAST:
        return low, high, False
    sizes = lens.front.half_width == lens.rear.half_width
    rims = rim_gap(lens) if sizes else (top, bottom)
    if flush != "front" and low < rims[0] + LEAST:
        raise ValueError(
            f"the flange from z = {low:.6g} mm meets the front, which reaches up to z = {rims[0]:.6g} mm; "
            "raise flange.seat"
        )
    if flush != "rear" and high > rims[1] - LEAST:
        raise ValueError(
            f"the flange up to z = {high:.6g} mm meets the rear, which reaches down to z = {rims[1]:.6g} mm; "
            "lower flange.thickness or flange.seat"
        )
    return low, high, True


def _levels(flange: MountFlange, lens: Lens) -> tuple[float, float, str]:
    """Return low and high of the flange, and the surface with which it is flush, "" for none."""
    if isinstance(flange.seat, str):
        surface = lens.front if flange.seat == "front" else lens.rear
        if not surface.is_plane:
            raise ValueError(
                f"the flange cannot be flush with the {flange.seat}, which is no plane; give z of its lower "
                "face as flange.seat in mm"
            )
        low = 0.0 if flange.seat == "front" else lens.thickness - flange.thickness
        return low, low + flange.thickness if flange.seat == "front" else lens.thickness, flange.seat
    return float(flange.seat), float(flange.seat) + flange.thickness, ""


def _down(distance: float, *sizes: float) -> float:
    """Return a lower bound of a distance that was computed from numbers of some size."""
    return distance - ROUNDINGS * EPS * sum(map(abs, sizes))


def _round_lens(mount: Mount, aperture: Outline) -> float:
    """Return how far the flange reaches beyond the lens at least, mm; refuse less than the wall."""
    flange, (a, b) = mount.flange, aperture.half_width
    if flange.outline == "round":
        c, d = aperture.corners
        reach = min(hypot(a - c, b - d) + max(c, d), hypot(a, b))  # not less than the farthest point
        width = _down(flange.half[0] - flange.inset - reach, flange.half[0], reach)
        needed = f"flange.diameter = {2 * (reach + flange.inset + mount.wall):.6g}"
        where = f"the corner of the lens at ({a:.6g}, {b:.6g}) mm"
        if not aperture.is_rectangle:
            where = f"the lens of {aperture.text()}"
    else:
        width = min(_down(f - flange.inset - h, f, h) for f, h in zip(flange.half, (a, b)))
        sizes = (2 * (h + flange.inset + mount.wall) for h in (a, b))
        needed = f"flange.size = [{', '.join(f'{size:.6g}' for size in sizes)}]"
        where = f"the lens of {2 * a:.6g} x {2 * b:.6g} mm"
    if width < mount.wall - LEAST:
        raise ValueError(
            f"the flange reaches {width:.6g} mm beyond {where}, less than wall = {mount.wall:g} mm; take at "
            f"least {needed} mm"
        )
    return width


def _beside(spot: Spot, aperture: Outline, clearance: float) -> float:
    """Return the distance of a spot from the clear aperture, mm; refuse less than the clearance."""
    a, b = aperture.half_width
    outside = _distance(spot.x, spot.y, aperture)
    gap = _down(outside - spot.radius, spot.x, spot.y, spot.radius, a, b)
    if gap < clearance - LEAST:
        where = f"|x| <= {a:.6g}, |y| <= {b:.6g} mm" if aperture.is_rectangle else f"of {aperture.text()}"
        how = f"reaches {-gap:.6g} mm into" if gap < 0 else f"keeps only {gap:.6g} mm from"
        raise ValueError(
            f"{spot} {how} the clear aperture {where}, where clearance = {clearance:g} mm is wanted; move it "
            "outward"
        )
    return gap


def _distance(x: float, y: float, outline: Outline) -> float:
    """Return the distance of a point from an outline, mm, from below; negative within."""
    (a, b), (c, d) = outline.half_width, outline.corners
    beyond, above = abs(x) - (a - c), abs(y) - (b - d)
    if min(beyond, above) <= 0 or outline.is_rectangle:  # a side is nearest
        return hypot(max(abs(x) - a, 0.0), max(abs(y) - b, 0.0)) or max(abs(x) - a, abs(y) - b)
    turn = np.linspace(0, np.pi / 2, DIRECTIONS)
    return float(
        (beyond * np.cos(turn) + above * np.sin(turn) - np.hypot(c * np.cos(turn), d * np.sin(turn))).max()
    )


def _within(spot: Spot, mount: Mount) -> float:
    """Return the distance of a spot from the outline of the flange, mm; refuse less than the wall."""
    flange = mount.flange
    if flange.outline == "round":
        rest = flange.half[0] - flange.inset - hypot(spot.x, spot.y) - spot.radius
    else:
        rest = min(h - flange.inset - abs(p) - spot.radius for h, p in zip(flange.half, (spot.x, spot.y)))
    rest = _down(rest, *flange.half, spot.x, spot.y, spot.radius)
    return _require_wall(rest, mount.wall, f"between {spot} and the outline of the flange")


def _apart(one: Spot, other: Spot, wall: float) -> float:
    """Return the distance between two spots, mm; refuse less than the wall."""
    rest = hypot(one.x - other.x, one.y - other.y) - one.radius - other.radius
    rest = _down(rest, one.x, one.y, other.x, other.y, one.radius, other.radius)
    return _require_wall(rest, wall, f"between {one} and {other}")


def _require_wall(rest: float, wall: float, where: str) -> float:
    if rest < wall - LEAST:
        raise ValueError(f"a wall of {rest:.6g} mm is left {where}, less than wall = {wall:g} mm")
    return rest


def _require_gate(mount: Mount, aperture: Outline) -> None:
    """Refuse a gate that is wider or thicker than the side that carries it."""
    gate, flange = mount.gate, mount.flange
    if gate is None:
        return
    axis = int(gate.side[1] == "y")
    along = flange.half[1 - axis] - flange.inset
    if flange.outline == "round":  # its ends lie on the circle, beside the lens
        along = max(along**2 - (aperture.half_width[axis] + mount.wall / 2) ** 2, 0.0) ** 0.5
    if gate.width / 2 > along:
        raise ValueError(
            f"the gate of {gate.width:g} mm is wider than the {2 * along:.6g} mm that the side {gate.side} "
            "of the flange carries; lower gate.width"
        )
    thickest = flange.thickness - 2 * flange.chamfer
    if gate.thickness > thickest:
        raise ValueError(
            f"the gate of {gate.thickness:g} mm is thicker than the side {gate.side} of the flange, "
            f"{thickest:.6g} mm; lower gate.thickness"
        )
