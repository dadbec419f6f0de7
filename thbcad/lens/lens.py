"""The closed lens: a freeform front and rear, and the ruled edges between their rims, four of a rectangle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thbcad.certified import Enclosure, minimum
from thbcad.checks import Floats, require_number, require_type
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.outlines import RELATIVE, walled_volume
from thbcad.pictures import card, line_path, svg
from thbcad.sags import gap_graph, volume_between
from thbcad.splines import BSplineSurface
from thbcad.surfaces import THBSurface

POINTS = 161  # of a line in a section of the picture
HEIGHT, WIDEST, GAP = 200.0, 300.0, 40.0  # pixels: of a section, and between the two
MOST_POLES = 100_000  # of a surface, up to which the volume takes 0.1 s
GLASS = 'fill="#cfe3f5" stroke="#333" stroke-linejoin="round"'
WORDS = 'font-size="11" fill="#333" text-anchor="middle"'


@dataclass(frozen=True)
class Lens:
    """A closed lens: front at z = 0, rear at z = thickness, ruled edges between the rims.

    It is a plain record: `require_sound` proves that neither surfaces nor edges cross.

    Raises ValueError : index below 1, that of a body which no light enters, or not finite, thickness not
        positive, outlines of front and rear that are not one, scaled with the half-widths.

    >>> flat = FreeformSurface((5.0, 4.0))
    >>> round(Lens(flat, flat, thickness=2.0, index=1.5).volume(), 9)
    160.0
    >>> convex = Lens(flat, FreeformSurface((5.0, 4.0), Conic(-50.0, -1.0)), thickness=2.0, index=1.5)
    >>> round(convex.least_thickness().value, 9)  # at the corner: 2 - (5^2 + 4^2) / 100
    1.59
    """

    front: FreeformSurface
    rear: FreeformSurface
    thickness: float
    index: float

    def __post_init__(self) -> None:
        for name in ("front", "rear"):
            require_type(name, getattr(self, name), FreeformSurface)
        require_number("thickness", self.thickness, above=0, finite=True)
        require_number("index", self.index, least=1, finite=True)
        for name in ("thickness", "index"):
            object.__setattr__(self, name, float(getattr(self, name)))
        front, rear = (s.outline.relative_corners for s in (self.front, self.rear))
        if max(abs(a - b) for a, b in zip(front, rear)) > RELATIVE:
            raise ValueError(
                f"front and rear must have one outline: corners of {front} and {rear} of the half-widths"
            )

    def __repr__(self) -> str:
        return f"Lens(front={self.front!r}, rear={self.rear!r}, {self.thickness:g} mm, n {self.index:g})"

    def _repr_html_(self) -> str:
        """Return two sections and some numbers for notebooks."""
        return _card(self)

    def least_thickness(self) -> Enclosure:
        """Return certified bounds of the least distance in z inside the outline, mm, and its position on the
        rear.

        Surfaces of different size are compared between points of equal relative position, as
        the ruled edges join them.  The bounds are those of the splines' difference as float64 holds it: its
        coefficients are rounded, and a conic that is no paraboloid lies within 1e-11 mm of its spline.
        """
        return self._least

    @cached_property
    def _least(self) -> Enclosure:
        gap = gap_graph(*self.graphs(), self.thickness)
        return minimum(gap, tolerance=1e-12, outline=self.rear.outline)

    def graphs(self) -> tuple[BSplineSurface, BSplineSurface]:
        """Return front and rear as scalar BSplineSurfaces of the same degrees (elevated where needed).

        Paraboloids, planes and sags are exact but for rounding, other conics are within a proven 1e-11 mm.

        Raises ValueError : degree 1, or a conic that needs more than 2000 control points per direction of
            degree 5.
        """
        return self._elevated

    def own_graphs(self) -> tuple[BSplineSurface, BSplineSurface]:
        """Return front and rear as `graphs`, each in the degrees that its own sag and conic need."""
        return self._own

    @cached_property
    def _own(self) -> tuple[BSplineSurface, BSplineSurface]:
        front, rear = (f.graph(self._degrees) for f in (self.front, self.rear))
        return front, rear

    @cached_property
    def _elevated(self) -> tuple[BSplineSurface, BSplineSurface]:
        own = self._own
        p, q = (max(getattr(graph, kv).degree for graph in own) for kv in ("kv_u", "kv_v"))
        front, rear = (graph.elevate(p, q) for graph in own)
        return front, rear

    @property
    def _degrees(self) -> tuple[int, int]:
        """The least degrees in x and y that hold both sags."""
        spaces = [f.sag.space for f in (self.front, self.rear) if f.sag is not None]
        bare = [f.conic for f in (self.front, self.rear) if f.sag is None]
        # conics that are no paraboloids need fewer knots of degree 5
        least = [5] if any(not conic.is_paraboloid for conic in bare) else []
        p, q = (
            max([*least, *(kv.degree for kv in knots)], default=3)
            for knots in ([space.kv_u for space in spaces], [space.kv_v for space in spaces])
        )
        return p, q

    def volume(self) -> float:
        """Return the volume in mm^3, by Gauss quadrature that is exact for the splines."""
        outline = self.rear.outline
        if outline.is_rectangle:
            return volume_between(*self.graphs(), self.thickness)
        return walled_volume(self.graphs(), self.thickness, outline, self.taper)

    @property
    def taper(self) -> tuple[float, float]:
        """Half-widths of the front over those of the rear: (1, 1) where the edges are upright."""
        (a, b), (c, d) = self.front.half_width, self.rear.half_width
        return a / c, b / d

    @property
    def faces(self) -> tuple[tuple[str, FreeformSurface, float], ...]:
        """(name, surface, z of its vertex in mm) of front and rear."""
        return ("front", self.front, 0.0), ("rear", self.rear, self.thickness)

    def with_rear(self, rear: FreeformSurface) -> Lens:
        """Return the lens with another rear surface."""
        return Lens(self.front, rear, self.thickness, self.index)

    @property
    def sags(self) -> tuple[THBSurface, ...]:
        """The sags of the surfaces that have one, front first."""
        return tuple(s.sag for s in self.free_surfaces if s.sag is not None)

    @property
    def free_surfaces(self) -> tuple[FreeformSurface, ...]:
        """Front and rear, as far as they have a sag."""
        return tuple(s for s in (self.front, self.rear) if s.sag is not None)

    def with_sags(self, sags: Sequence[THBSurface]) -> Lens:
        """Return the lens with other sags on the surfaces that have one, front first.

        Raises ValueError : too few or too many sags.
        """
        if len(sags) != len(self.sags):
            raise ValueError(f"sags must be {len(self.sags)} surfaces, got {len(sags)}")
        rest = iter(sags)
        front, rear = (s if s.sag is None else s.with_sag(next(rest)) for s in (self.front, self.rear))
        return Lens(front, rear, self.thickness, self.index)


def _card(lens: Lens) -> str:
    """Return the sections y = 0 and x = 0 beside the numbers of a lens, as HTML of at most 40 kB."""
    sections = [_section(lens, axis) for axis in (0, 1)]
    low, high = (f([f(s, axis=0) for s in sections], axis=0) for f in (np.min, np.max))
    scale = min(HEIGHT / (high[1] - low[1]), WIDEST / (high[0] - low[0]))
    width, height = (high - low) * scale
    shift = max(width, GAP) + GAP
    content = ""
    for k, (section, name) in enumerate(zip(sections, ("y = 0", "x = 0"))):
        points = (section - low) * [scale, -scale] + [k * shift + GAP / 2, height]
        content += f'<path {GLASS} d="{line_path(points)}Z"/>'
        content += f'<text {WORDS} x="{points[:, 0].mean():.4g}" y="{height + 14:.4g}">{name}</text>'
    middle = lens.thickness + lens.rear(0, 0) - lens.front(0, 0)
    rows = [
        ("index", f"{lens.index:.6g}"),
        ("thickness", f"{lens.thickness:.6g} mm, {middle:.6g} mm in the middle"),
        ("front", lens.front.outline.text()),
        ("rear", lens.rear.outline.text()),
        ("degrees of freedom", sum(sag.space.dim for sag in lens.sags)),
        *_volume(lens),
    ]
    return card("Lens", svg(content, 2 * shift, height + 18), rows)


def _section(lens: Lens, axis: int) -> Floats:
    """Return the outline of the section along x (axis 0) or y as points (z, x or y), mm."""
    lines = []
    for face, vertex in ((lens.front, 0.0), (lens.rear, lens.thickness)):
        along = np.linspace(-1, 1, POINTS) * face.half_width[axis]
        z = face(along, 0 * along) if axis == 0 else face(0 * along, along)
        lines.append(np.column_stack([vertex + z, along]))
    return np.concatenate([lines[0], lines[1][::-1]])


def _volume(lens: Lens) -> list[tuple[str, str]]:
    """Return the volume as a row, where it is quickly found: conics that need no approximation, few poles."""
    spaces = [sag.space for sag in lens.sags]
    exact = all(face.conic.is_paraboloid for face in (lens.front, lens.rear))
    if not exact or any(min(space.kv_u.degree, space.kv_v.degree) < 2 for space in spaces):
        return []
    if any(not s.is_compact or s.embedding.kv_u.dim * s.embedding.kv_v.dim > MOST_POLES for s in spaces):
        return []
    return [("volume", f"{lens.volume():.6g} mm^3")]
