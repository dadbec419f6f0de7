"""A lens as two sections with its numbers, and a freeform surface as a map of its sag."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats
from thbcad.hierarchy import space_rows
from thbcad.outlines import Outline
from thbcad.pictures import card, frame_size, interval_text, line_path, map_element, svg
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface, value_map

POINTS = 161  # of a line in a section
HEIGHT, WIDEST, GAP = 200.0, 300.0, 40.0  # pixels: of a section, and between the two
MOST_POLES = 100_000  # of a surface, up to which the volume takes 0.1 s
GLASS = 'fill="#cfe3f5" stroke="#333" stroke-linejoin="round"'
WORDS = 'font-size="11" fill="#333" text-anchor="middle"'


class Face(Protocol):
    """What is shown of a freeform surface."""

    @property
    def half_width(self) -> tuple[float, float]: ...
    @property
    def outline(self) -> Outline: ...
    @property
    def conic(self) -> Conic: ...
    @property
    def sag(self) -> THBSurface | None: ...
    def __call__(self, x: ArrayLike, y: ArrayLike) -> Floats: ...
    def grid(self, x: ArrayLike, y: ArrayLike) -> Floats: ...


class Body(Protocol):
    """What is shown of a lens."""

    @property
    def front(self) -> Face: ...
    @property
    def rear(self) -> Face: ...
    @property
    def thickness(self) -> float: ...
    @property
    def index(self) -> float: ...
    @property
    def sags(self) -> tuple[THBSurface, ...]: ...
    def volume(self) -> float: ...


def lens_card(lens: Body) -> str:
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
        *((f"{name}", _extent(face)) for name, face in (("front", lens.front), ("rear", lens.rear))),
        ("degrees of freedom", sum(sag.space.dim for sag in lens.sags)),
        *_volume(lens),
    ]
    return card("Lens", svg(content, 2 * shift, height + 18), rows)


def surface_card(surface: Face) -> str:
    """Return a map of the sag, or without one of z, beside the numbers of a surface, as HTML of at most 40
    kB."""
    size = frame_size(*surface.half_width)
    rows: list[tuple[str, object]] = [
        ("size", _extent(surface)),
        ("radius", "plane" if surface.conic.is_plane else f"{surface.conic.radius:.6g} mm"),
        ("conic constant", f"{surface.conic.constant:.6g}"),
    ]
    unit = surface.outline.scaled((1.0, 1.0))
    if surface.sag is None:
        x, y = (np.linspace(-h, h, POINTS) for h in surface.half_width)
        values = surface.grid(x, y)
        shown = values[surface.outline.contains(x[:, None], y)]
        picture = map_element(np.clip(values, shown.min(), shown.max()), *size)
        rows.append(_span("z", shown))
    else:
        picture, shown, drawn = value_map(surface.sag, size, unit.contains)
        rows += [_span("sag", shown), *space_rows(surface.sag.space, drawn)[:4]]
    return card("FreeformSurface", svg(picture + _cover(unit, *size), *size), rows)


def _cover(unit: Outline, width: float, height: float) -> str:
    """Return what hides the corners of a picture that lie outside an outline of half-widths 1."""
    if unit.is_rectangle:
        return ""
    turn = np.linspace(0, 2 * np.pi, POINTS)
    ring = np.stack([np.cos(turn), np.sin(turn)])
    ring = (1 + ring / unit.gauge(*ring)) / 2
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    lines = (line_path(points * [width, height]) for points in (corners, ring.T))
    return f'<path fill="#fff" fill-rule="evenodd" d="{"Z".join(lines)}Z"/>'


def _section(lens: Body, axis: int) -> Floats:
    """Return the outline of the section along x (axis 0) or y as points (z, x or y), mm."""
    lines = []
    for face, vertex in ((lens.front, 0.0), (lens.rear, lens.thickness)):
        along = np.linspace(-1, 1, POINTS) * face.half_width[axis]
        z = face(along, 0 * along) if axis == 0 else face(0 * along, along)
        lines.append(np.column_stack([vertex + z, along]))
    return np.concatenate([lines[0], lines[1][::-1]])


def _extent(face: Face) -> str:
    return face.outline.text()


def _span(name: str, values: Floats) -> tuple[str, str]:
    return name, interval_text(values.min(), values.max(), "mm")


def _volume(lens: Body) -> list[tuple[str, str]]:
    """Return the volume as a row, where it is quickly found: conics that need no approximation, few poles."""
    spaces = [sag.space for sag in lens.sags]
    exact = all(face.conic.is_paraboloid for face in (lens.front, lens.rear))
    if not exact or any(min(space.kv_u.degree, space.kv_v.degree) < 2 for space in spaces):
        return []
    if any(not s.is_compact or s.embedding.kv_u.dim * s.embedding.kv_v.dim > MOST_POLES for s in spaces):
        return []
    return [("volume", f"{lens.volume():.6g} mm^3")]
