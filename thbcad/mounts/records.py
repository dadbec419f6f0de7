"""What a mount consists of: a flange, holes, pins, bosses and a gate, in mm in the frame of the lens."""

from dataclasses import dataclass, field, fields
from math import cos, pi, sin, tan
from typing import Any

from thbcad.checks import require_integer, require_number, shown

Point = tuple[float, float]

SIDES = ("front", "rear")
WORDS = ("pin", "boss")
EDGES = ("-x", "+x", "-y", "+y")
LEAST = 1e-6  # mm; ten times what CAD programs take for one point, and what limits may be missed by
LARGEST = 1e5  # mm; OCCT's tolerance of 1e-7 mm is far above rounding up to there
STEEPEST = 45.0  # degrees of draft: beyond it a side is rather a chamfer


def number(default: Any, **limits: float) -> Any:
    """Return a field that holds a finite number within limits, as `require_number` has them."""
    return field(default=default, metadata=limits)


def _checked(record: Any, where: str) -> None:
    """Make the numbers of a record float; raise ValueError where one is none or beyond its limits."""
    for item in fields(record):
        if item.metadata:
            value = getattr(record, item.name)
            _require_number(f"{where}.{item.name}", value, **item.metadata)
            object.__setattr__(record, item.name, float(value))


def _require_number(name: str, value: Any, **limits: float) -> None:
    require_number(name, value, finite=True, **limits)
    if abs(value) > LARGEST:
        raise ValueError(f"{name} must be at most {LARGEST:g} in size, got {value:g}")
    if limits and 0 < value < LEAST:
        raise ValueError(f"{name} must be {'0 or ' * ('least' in limits)}at least {LEAST:g}, got {value:g}")


def _require_choice(where: str, value: object, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise ValueError(f"{where} must be one of {', '.join(map(repr, choices))}, got {shown(value)}")


@dataclass(frozen=True)
class MountFlange:
    """A plate round a lens.

    outline : "rectangular" with size, or "round" with diameter; its middle is the optical axis
    size : (x, y), mm.  diameter : mm.  thickness : mm
    seat : "front" or "rear", with which it is flush where that is a plane; or z of its lower face, mm
    chamfer : mm, of its outer edges
    draft : degrees, by which its sides lean inward, away from the seat
    """

    thickness: float = number(0.0, above=0.0)
    outline: str = "rectangular"
    size: Point | None = None
    diameter: float | None = None
    seat: str | float = "front"
    chamfer: float = number(0.0, least=0.0)
    draft: float = number(0.0, least=0.0)

    def __post_init__(self) -> None:
        _checked(self, "flange")
        _require_choice("flange.outline", self.outline, ("rectangular", "round"))
        wanted, other = ("diameter", "size") if self.outline == "round" else ("size", "diameter")
        if getattr(self, wanted) is None or getattr(self, other) is not None:
            raise ValueError(f"a {self.outline} flange takes flange.{wanted}, and not flange.{other}")
        pair = (self.diameter, self.diameter) if self.size is None else self.size
        if not isinstance(pair, list | tuple) or len(pair) != 2:
            raise ValueError(f"flange.size must be two numbers [x, y], got {shown(pair)}")
        for value in pair:
            _require_number(f"flange.{wanted}", value, above=0.0)
        if self.size is not None:
            object.__setattr__(self, "size", tuple(map(float, self.size)))
        if isinstance(self.seat, str):
            _require_choice("flange.seat", self.seat, SIDES)
        else:
            _require_number("flange.seat", self.seat)
        if self.draft > STEEPEST:
            raise ValueError(f"flange.draft must be at most {STEEPEST:g} degrees, got {self.draft:g}")
        if 2 * self.chamfer > self.thickness - LEAST:
            raise ValueError(
                f"the flange cuts itself: chamfers of {self.chamfer:g} mm need more than its thickness of "
                f"{self.thickness:g} mm; lower flange.chamfer"
            )
        if min(self.half) < self.inset + LEAST:
            raise ValueError(
                f"the flange cuts itself: draft and chamfer move its sides inward by {self.inset:.6g} mm, "
                f"more than its half-width of {min(self.half):.6g} mm; lower flange.draft"
            )

    @property
    def half(self) -> Point:
        """Half-widths of the outline at the seat, mm."""
        x, y = (self.diameter, self.diameter) if self.size is None else self.size
        return x / 2, y / 2  # type: ignore[operator]

    @property
    def inset(self) -> float:
        """How far draft and chamfer move the sides inward at most, mm."""
        return self.thickness * tan(self.draft * pi / 180) + self.chamfer

    def sections(self) -> list[Point]:
        """Return (distance from the seat, how far the sides are moved inward there), mm."""
        slope, c, t = tan(self.draft * pi / 180), self.chamfer, self.thickness
        straight = [(c, slope * c), (t - c, slope * (t - c))]
        return [(0.0, c), *straight, (t, self.inset)] if c else straight


@dataclass(frozen=True)
class Places:
    """Positions: points (x, y) in mm, or `count` of them on a circle round the axis.

    circle : its diameter, mm.  start : angle of the first, degrees from +x
    """

    at: tuple[Point, ...] = ()
    circle: float = number(0.0, least=0.0)
    count: int = 0
    start: float = number(0.0)

    def __post_init__(self) -> None:
        if isinstance(self.at, list | tuple):
            points = tuple(tuple(point) if isinstance(point, list) else point for point in self.at)
            object.__setattr__(self, "at", points)

    def points(self, where: str) -> list[Point]:
        """Return the positions, mm; raise ValueError where there are none, or both kinds."""
        _checked(self, where)
        require_integer(f"{where}.count", self.count, 0, 1000)
        no_circle = not (self.circle or self.count or self.start)
        if not (no_circle if self.at else self.circle and self.count):
            raise ValueError(f"{where} must have either at = [[x, y], ...] or circle and count")
        for point in self.at:
            if not isinstance(point, list | tuple) or len(point) != 2:
                raise ValueError(f"{where}.at must be pairs [x, y], got {shown(point)}")
            for value in point:
                _require_number(f"{where}.at", value)
        turns = (self.start * pi / 180 + 2 * pi * k / max(self.count, 1) for k in range(self.count))
        round_axis = [(self.circle / 2 * cos(t), self.circle / 2 * sin(t)) for t in turns]
        return [(float(x), float(y)) for x, y in self.at] or round_axis


@dataclass(frozen=True)
class Hole:
    """Screw holes through the flange, with countersinks where their diameter is not 0.

    places : Places.  diameter, countersink : mm.  angle : of the countersink, degrees
    side : "front" or "rear", from which the screws come
    """

    places: Places
    diameter: float = number(0.0, above=0.0)
    countersink: float = number(0.0, least=0.0)
    angle: float = number(90.0, above=0.0)
    side: str = "rear"

    def __post_init__(self) -> None:
        _checked(self, "holes")
        _require_choice("holes.side", self.side, SIDES)
        if self.countersink and self.countersink < self.diameter + LEAST:
            raise ValueError(
                f"holes.countersink must be greater than the diameter {self.diameter:g} mm, got "
                f"{self.countersink:g} mm"
            )
        if self.angle >= 180:
            raise ValueError(f"holes.angle must be below 180 degrees, got {self.angle:g}")

    @property
    def radius(self) -> float:
        """The greatest radius, mm."""
        return max(self.diameter, self.countersink) / 2

    @property
    def sink(self) -> float:
        """The depth of the countersink, mm."""
        if not self.countersink:
            return 0.0
        return (self.countersink - self.diameter) / 2 / tan(self.angle / 2 * pi / 180)


@dataclass(frozen=True)
class Post:
    """Pins or bosses on one side of the flange.

    word : "pin" or "boss".  places : Places.  diameter, length : mm
    side : "front" or "rear", to which they point
    chamfer : mm, of their ends.  bore : mm, diameter of a hole in each, 0 for none
    """

    word: str
    places: Places
    diameter: float = number(0.0, above=0.0)
    length: float = number(0.0, above=0.0)
    side: str = "rear"
    chamfer: float = number(0.0, least=0.0)
    bore: float = number(0.0, least=0.0)

    def __post_init__(self) -> None:
        _require_choice("the word of a post", self.word, WORDS)
        where = "bosses" if self.word == "boss" else "pins"
        _checked(self, where)
        _require_choice(f"{where}.side", self.side, SIDES)
        if self.chamfer > min(self.length, (self.diameter - self.bore) / 2) - LEAST:
            raise ValueError(
                f"{where}.chamfer must be below their length and their wall, got {self.chamfer:g} mm at "
                f"{self.diameter:g} mm with a bore of {self.bore:g} mm"
            )


@dataclass(frozen=True)
class Gate:
    """The gate of a mould: a tab on one side of the flange.

    side : "-x", "+x", "-y" or "+y".  width, length, thickness : mm; length counts from the flange outward
    """

    side: str = "+x"
    width: float = number(0.0, above=0.0)
    length: float = number(0.0, above=0.0)
    thickness: float = number(0.0, above=0.0)

    def __post_init__(self) -> None:
        _checked(self, "gate")
        _require_choice("gate.side", self.side, EDGES)


@dataclass(frozen=True)
class Mount:
    """A flange with what is on it.

    wall : mm, the least thickness of the flange and of what is left between its parts
    clearance : mm, the least distance of holes, pins and bosses from the clear aperture
    """

    flange: MountFlange
    holes: tuple[Hole, ...] = ()
    posts: tuple[Post, ...] = ()
    gate: Gate | None = None
    wall: float = number(0.8, above=0.0)
    clearance: float = number(0.1, least=0.0)

    def __post_init__(self) -> None:
        _checked(self, "mount")
        for name in ("holes", "posts"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
