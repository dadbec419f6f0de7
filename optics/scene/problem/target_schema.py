"""The records of target and stops in a problem file: every key with its default and limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import inf, isinf
from typing import ClassVar

from optics.scene.keys import FARTHEST, LONGEST, SHORTEST, Rows, option, record
from optics.scene.photometry import REGULATIONS, regulation

SHAPES = ("rectangle", "ellipse", "ring")  # of stops
MAX_PIXELS = 4096
OF_PICTURES = {"kind": ("image",)}


@dataclass(frozen=True, kw_only=True)
class StopSpec:
    """An absorbing plate without thickness, as a table [[stop]].

    >>> StopSpec(shape="ellipse", half_width=(8, 8), position=(0, 0, -5)).hole  # a plate with a hole in it
    True
    """

    name: str = option("", note="each has its own; --set stop.NAME.position=[0, 0, -5] changes a key of it")
    shape: str = option(choices=SHAPES, note="of the hole, or of the obstacle")
    half_width: tuple[float, float] = option(low=SHORTEST, high=LONGEST, note="mm in own x and y")
    inner: tuple[float, float] = option(
        (0.0, 0.0),
        low=0,
        high=LONGEST,
        note="mm, of a ring: the half-widths where it begins",
        only={"shape": ("ring",)},
    )
    position: tuple[float, float, float] = option(size=(0, FARTHEST), note="mm, of its middle")
    tilt: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), size=(0, 360), note="right-handed degrees about own x, then own y, then own z"
    )
    hole: bool = option(
        True, note="the shape is a hole in a plate without end; false: an obstacle of this shape"
    )


@dataclass(frozen=True, kw_only=True)
class Zone:
    """Limits of the light at places of the target, as a table [[target.zone]]; each of its points is a row.

    Places are (H, V): in the far field the angles of a goniometer, u = H and v = atan(tan V / cos H) of the
    target's pixels; on other targets x and y in mm.

    >>> Zone(box=((-9, -4), (9, -1.7)), greatest=12000).shape
    ('box', ((-9, -4), (9, -1.7)))
    """

    name: str = option("", note="each has its own; --set target.zone.NAME.least=5000 changes a key of it")
    points: Rows = option(
        (),
        size=(0, FARTHEST),
        note="[[H, V], ...]: degrees of a goniometer, v = atan(tan V / cos H), or mm; each by itself; "
        "H along +x",
    )
    box: Rows = option((), size=(0, FARTHEST), note="two opposite corners; limits hold everywhere within")
    line: Rows = option((), size=(0, FARTHEST), note="from corner to corner; limits hold all along")
    polygon: Rows = option((), size=(0, FARTHEST), note="corners; limits hold everywhere within")
    least: float = option(0.0, low=0, note="cd, on other targets than the far field lx; 0 is none")
    greatest: float = option(inf, above=0, infinite=True, note="the same; inf is none")
    least_of_peak: float = option(0.0, low=0, high=1, note="least, of the greatest on the target; 0 is none")
    peak: bool = option(False, note="limits are those of its brightest place; alone: of the whole target")
    margin: float = option(0.3, low=0, high=10, note="that the design aims at, of each limit")
    unit: str = option("", choices=("", "cd", "lx"), note="of the limits; empty is that of the target")

    @property
    def shape(self) -> tuple[str, Rows]:
        """What it covers, with its corners; the whole target where it names nothing."""
        shapes = ((name, getattr(self, name)) for name in ("points", "box", "line", "polygon"))
        return next((shape for shape in shapes if shape[1]), ("whole", ()))


@cache
def regulated(name: str) -> tuple[tuple[str, Zone], ...]:
    """Return the zones of a regulation, each with what its rows are called."""
    table = regulation(name)
    zones = (record(Zone, {"unit": table.unit} | row) for row in table.zone)
    return tuple((f"{name} {zone.name}".rstrip(), zone) for zone in zones)


@dataclass(frozen=True, kw_only=True)
class Target:
    """The light that is asked for, as the table [target].

    >>> Target(kind="image", image="pearl.png", distance=300, half_width=(100, 100)).placing
    'crop'
    """

    kind: str = option(
        choices=("image", "tophat", "function", "zones"),
        note="a picture, a region of uniform light, a formula, or the smoothest light that keeps the zones",
    )
    image: str = option(
        "", note="picture file, relative to the problem file; of kind image", picture=True, only=OF_PICTURES
    )
    formula: str = option(
        "",
        note="light at x, y from -1 to 1 over the target, y upward; of kind function",
        only={"kind": ("function",)},
    )
    shape: str = option(
        "rectangle",
        choices=("rectangle", "ellipse", "crescent"),
        note="of the region of kind tophat",
        only={"kind": ("tophat",)},
    )
    lit: tuple[float, float] = option(
        (0.75, 0.75),
        above=0,
        high=1,
        note="width and height of that region, relative to the target's",
        only={"kind": ("tophat",)},
    )
    distance: float | None = option(
        None,
        low=SHORTEST,
        high=FARTHEST,
        infinite=True,
        note="mm from the rear vertex to the middle of the target, on the axis; inf is the far field",
        example=400.0,
    )
    position: tuple[float, float, float] | None = option(
        None, size=(0, FARTHEST), note="mm, of the target's middle, in place of distance"
    )
    tilt: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), size=(0, 360), note="right-handed degrees about own x, then own y, then own z"
    )
    surface: str = option(
        "plane",
        choices=("plane", "cylinder", "sphere", "far_field"),
        note="what is lit, from its own -z; the axis of a cylinder is its own y; on a sphere x and y are "
        "arcs of longitude and latitude",
    )
    radius: float = option(
        inf,
        size=(SHORTEST, FARTHEST),
        infinite=True,
        note="mm, of a cylinder or a sphere; above 0 it bulges to the light",
        only={"surface": ("cylinder", "sphere")},
    )
    half_width: tuple[float, float] = option(
        low=SHORTEST,
        high=FARTHEST,
        note="mm in own x and y, from the middle to the border, along the surface; degrees in the far field",
    )
    encoding: str = option(
        "srgb", choices=("srgb", "linear"), note="of the picture's numbers", only=OF_PICTURES
    )
    pixels: tuple[int, int] = option((256, 256), low=2, high=MAX_PIXELS, note="columns, rows")
    fit: str = option(
        "crop", choices=("crop", "pad", "stretch"), note="for pictures of another shape", only=OF_PICTURES
    )
    seen_from: str = option(
        "behind",
        choices=("behind", "lens"),
        note="where the picture reads right: behind the target looking at the lens, or from the lens's side",
        only={"kind": ("image", "zones")},
    )
    crossing: bool = option(False, note="light crosses on its way, so that the lens is about twice as curved")
    regulation: str = option("", choices=("", *REGULATIONS), note="its table, as zones before those below")
    zone: tuple[Zone, ...] = option((), note="limits of the light at places; any number of them")
    aperture: float = option(
        0.0,
        low=0,
        high=FARTHEST,
        note="degrees (mm), width over which zones are read; 0: 0.15 degrees, on other targets a pixel",
    )

    data: ClassVar[str] = "image"  # the key of the file that the target is read from, where it names one

    @property
    def zones(self) -> tuple[tuple[str, Zone], ...]:
        """The zones of the regulation and its own, each with what its rows are called."""
        own = ((zone.name or f"zone {k}", zone) for k, zone in enumerate(self.zone))
        return *(regulated(self.regulation) if self.regulation else ()), *own

    @property
    def placing(self) -> str:
        """How the light is laid on the pixels: `fit` for pictures.

        Regions and formulas are made on the pixels themselves.
        """
        return self.fit if self.kind == "image" else "stretch"

    @property
    def far_field(self) -> bool:
        """Whether light is asked for by direction."""
        return self.surface == "far_field" or self.distance == inf

    @property
    def curved(self) -> bool:
        """Whether light is asked for on a curved surface."""
        return self.surface in ("cylinder", "sphere")

    @property
    def gentler(self) -> str:
        """What lets light be bent less, in words."""
        if self.far_field:
            farther = "turn target.tilt nearer the axis"
        elif self.position is None:
            farther = "target.distance larger"
        else:
            farther = "move target.position nearer the axis"
        return f"make target.half_width smaller or {farther}"

    @property
    def place(self) -> str:
        """What is lit, and where it lies, in words."""
        parts = []
        if not isinf(self.radius):
            parts.append(f"on a {self.surface} of radius {self.radius:g} mm")
        if self.far_field:
            parts.append("in the far field")
        elif self.position is None:
            parts.append(f"{self.distance:g} mm behind the lens")
        else:
            parts.append("at ({:g}, {:g}, {:g}) mm".format(*self.position))
        if any(self.tilt):
            parts.append("tilted by ({:g}, {:g}, {:g}) degrees".format(*self.tilt))
        return ", ".join(parts)
