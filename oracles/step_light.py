"""The light of a parallel beam behind the lens of a STEP file, by numpy and scipy alone: nothing of `thbcad`
or `optics` is used.

The numbers of the faces "front" and "rear" are read from the file's text.  The front must be a plane across
the beam, so that rays along z meet a rear z(x, y) without a search.  Snell's and Fresnel's laws then carry
the corners of a grid of cells to the target, where a cell becomes a quadrilateral that holds its flux evenly.
It lights every pixel with the part of its area that lies there (polygons clipped after Sutherland and
Hodgman).  The error falls with the square of the cells' size, so that images of n^2 and (2 n)^2 cells give
(4 E_2n - E_n) / 3, without that term.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.sparse import csr_array

FLAT = 1e-12  # of the size: how far the rear's poles are from equal steps in x and y
LINES = 32  # of cells that are traced at once
NUMBER = r"[-+]?\d+\.?\d*(?:E[-+]?\d+)?"

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Polygons = tuple[Floats, Floats]  # columns and rows of the corners, (m, n) each


@dataclass(frozen=True, eq=False)
class Beam:
    """Parallel light along +z on |x| <= half_width[0], |y| <= half_width[1].

    flux : W, spread evenly.  index : of the glass.  target : z, mm.
    """

    half_width: tuple[float, float]
    flux: float
    index: float
    target: float


@dataclass(frozen=True)
class Pixels:
    """counts : (columns, rows) that tile |x| <= half_width[0], |y| <= half_width[1]; row 0 at +y."""

    half_width: tuple[float, float]
    counts: tuple[int, int]

    @property
    def area(self) -> float:
        return float(np.prod([2 * h / n for h, n in zip(self.half_width, self.counts)]))

    def places(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return (column, row) of points, in pixels from the corner at -x, +y."""
        (hx, hy), (columns, rows) = self.half_width, self.counts
        return (x + hx) * (columns / (2 * hx)), (hy - y) * (rows / (2 * hy))


@dataclass(frozen=True, eq=False)
class Face:
    """A B-spline surface whose x follows u and whose y follows v.

    knots, degrees, ranges : two each, ranges in mm.  heights : (n_u, n_v) mm.
    """

    knots: tuple[Floats, Floats]
    degrees: tuple[int, int]
    ranges: tuple[Floats, Floats]
    heights: Floats

    def grid(self, x: Floats, y: Floats, orders: tuple[int, int] = (0, 0)) -> Floats:
        """Return z or a derivative at all pairs of x and y, (nx, ny)."""
        by_x, by_y = (self._basis(axis, p, orders[axis]) for axis, p in enumerate((x, y)))
        return by_x @ (by_y @ self.heights.T).T

    def _basis(self, axis: int, points: Floats, order: int) -> csr_array:
        """Return the values, or first derivatives by mm, of all basis functions, (points, n)."""
        knots, degree, ends = self.knots[axis], self.degrees[axis], self.ranges[axis]
        speed = (knots[-1] - knots[0]) / (ends[1] - ends[0])
        at = np.clip(knots[0] + (points - ends[0]) * speed, knots[0], knots[-1])
        if order == 0:
            return BSpline.design_matrix(at, knots, degree)
        width = knots[1 + degree : -1] - knots[1 : -1 - degree]
        lower = BSpline.design_matrix(at, knots[1:-1], degree - 1)
        steps = np.diff(np.eye(len(knots) - degree - 1), axis=0) * (speed * degree / width)[:, None]
        return lower @ csr_array(steps)


def read_rear(path: Path) -> Face:
    """Return the face named "rear" of a STEP file whose "front" is a plane across z.

    Raises ValueError : another front, a rear that is no spline, or poles that are not at equal steps of their
        knots' means.
    """
    text = path.read_text("ascii").replace("\n", "")
    data = dict(re.findall(r"#(\d+)=(.*?);", text))
    named = {}
    for entity in data.values():
        found = re.match(r"ADVANCED_FACE\('(front|rear)',\(.*?\),#(\d+),", entity)
        if found:
            named[found[1]] = data[found[2]]
    _require_flat(named["front"], data)
    return _face(named["rear"], data)


def _require_flat(entity: str, data: dict[str, str]) -> None:
    """Raise ValueError unless an entity is a PLANE whose normal is the z direction."""
    placement = re.match(r"PLANE\('',#(\d+)\)", entity)
    axis = placement and re.match(r"AXIS2_PLACEMENT_3D\('',#\d+,#(\d+)", data[placement[1]])
    normal = re.findall(NUMBER, data[axis[1]].partition(",")[2]) if axis else []
    if [abs(float(n)) for n in normal] != [0, 0, 1]:
        raise ValueError(f"wanted a plane front across the beam, got {entity[:60]!r}")


def _face(entity: str, data: dict[str, str]) -> Face:
    found = re.match(
        r"B_SPLINE_SURFACE_WITH_KNOTS\('',(\d+),(\d+),\((.*?\))\),\.\w+\.,\.F\.,\.F\.,\.\w+\.,"
        r"\((.*?)\),\((.*?)\),\((.*?)\),\((.*?)\),\.\w+\.\)",
        entity.replace(" ", ""),
    )
    if not found:
        raise ValueError(f"wanted a B-spline surface, got {entity[:60]!r}")
    degrees = int(found[1]), int(found[2])
    rows = [re.findall(r"#(\d+)", row) for row in found[3].split("),(")]
    poles = np.array([[re.findall(NUMBER, data[k].partition(",")[2]) for k in row] for row in rows], float)
    times = [np.array(found[k].split(","), int) for k in (4, 5)]
    knots = tuple(np.repeat(np.array(found[6 + k].split(","), float), times[k]) for k in (0, 1))
    ranges = []
    for axis in (0, 1):
        across = np.moveaxis(poles[..., axis], axis, 0)
        own, p = knots[axis], degrees[axis]
        means = np.array([own[i + 1 : i + p + 1].mean() for i in range(len(own) - p - 1)])
        line = np.interp(means, own[[0, -1]], across[[0, -1], 0])
        if np.abs(across - line[:, None]).max() > FLAT * np.abs(line).max():
            raise ValueError("wanted a surface whose x and y are linear in its parameters")
        ranges.append(across[[0, -1], 0])
    return Face(knots, degrees, tuple(ranges), poles[..., 2])


def cell_image(rear: Face, beam: Beam, pixels: Pixels, count: int) -> Floats:
    """Return the irradiance (rows, columns), W/mm^2, of count^2 cells of the beam.

    Raises ValueError : a beam beside the rear, total reflection.
    """
    if any(h > min(abs(ends)) for h, ends in zip(beam.half_width, rear.ranges)):
        raise ValueError("wanted a beam that meets the rear everywhere")
    image = np.zeros(pixels.counts[::-1])
    cell = beam.flux / count**2
    x, y = (h * (2 * np.arange(count + 1) / count - 1) for h in beam.half_width)
    for start in range(0, count, LINES):
        column, row, passing = _landed(rear, beam, pixels, x[start : start + LINES + 1], y)
        mean = (passing[1:, 1:] + passing[1:, :-1] + passing[:-1, 1:] + passing[:-1, :-1]) / 4
        corners = tuple(
            np.stack([a[:-1, :-1], a[1:, :-1], a[1:, 1:], a[:-1, 1:]]).reshape(4, -1) for a in (column, row)
        )
        _lay(image, corners, cell * mean.ravel())
    return image / pixels.area


def _landed(rear: Face, beam: Beam, pixels: Pixels, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the columns and rows where rays at all pairs of x and y land, and the part that arrives."""
    z, by_x, by_y = (rear.grid(x, y, orders) for orders in ((0, 0), (1, 0), (0, 1)))
    index = beam.index
    cos_i = 1 / np.sqrt(1 + by_x**2 + by_y**2)
    cos_t = np.sqrt(1 - index**2 * (1 - cos_i**2))
    if np.isnan(cos_t).any():
        raise ValueError("wanted a rear that reflects no ray totally")
    along_normal = (cos_t - index * cos_i) * cos_i
    travel = (beam.target - z) / (index + along_normal)
    column, row = pixels.places(
        x[:, None] - travel * along_normal * by_x, y[None, :] - travel * along_normal * by_y
    )
    parallel = (index * cos_t - cos_i) / (index * cos_t + cos_i)
    across = (index * cos_i - cos_t) / (index * cos_i + cos_t)
    entering = 1 - ((index - 1) / (index + 1)) ** 2
    return column, row, entering * (1 - (parallel**2 + across**2) / 2)


def _bin(image: Floats, column: Floats, row: Floats, flux: Floats) -> None:
    """Add flux to the pixels of whole columns and rows, where there are such."""
    rows, columns = image.shape
    seen = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    at = (row[seen] * columns + column[seen]).astype(np.int64)
    image += np.bincount(at, flux[seen], image.size).reshape(image.shape)


def _lay(image: Floats, corners: Polygons, flux: Floats) -> None:
    """Add convex quadrilaterals, (4, n); another one is put where its middle lies."""
    turns = _cross(*(np.roll(a, -1, axis=0) - a for a in corners))
    convex = (turns > 0).all(axis=0) | (turns < 0).all(axis=0)
    cut = convex & (np.floor(corners).max(axis=1) > np.floor(corners).min(axis=1)).any(axis=0)
    _bin(image, *(np.floor(a[:, ~cut].mean(axis=0)) for a in corners), flux[~cut])
    corners = corners[0][:, cut], corners[1][:, cut]
    density = flux[cut] / _area(corners)
    pieces, column, owner = _strips(corners, 0)
    pieces, row, part = _strips(pieces, 1)
    _bin(image, column[part], row, _area(pieces) * density[owner[part]])


def _cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products of edges and the next ones."""
    return a * np.roll(b, -1, axis=0) - np.roll(a, -1, axis=0) * b


def _area(polygon: Polygons) -> Floats:
    """Return the signed areas."""
    return _cross(*(a - a[0] for a in polygon)).sum(axis=0) / 2


def _strips(polygon: Polygons, axis: int) -> tuple[Polygons, Floats, Ints]:
    """Return the parts of convex polygons in strips of one pixel, the number of the strip, and that of the
    polygon, (k,) each."""
    first, last = (np.floor(bound(polygon[axis], axis=0)) for bound in (np.min, np.max))
    crossed = np.int64(last - first) + 1
    owner = np.repeat(np.arange(crossed.size), crossed)
    strip = first[owner] + np.arange(owner.size) - (np.cumsum(crossed) - crossed)[owner]
    cut = crossed[owner] > 1
    parts = tuple(a[:, owner[cut]] for a in polygon)
    parts = _beyond(parts, axis, 1.0, strip[cut])
    parts = _beyond(parts, axis, -1.0, strip[cut] + 1)
    out = tuple(np.concatenate([a[:, owner], a[:1, owner], a[:1, owner]]) for a in polygon)
    for every, some in zip(out, parts):
        every[:, cut] = some
    return out, strip, owner


def _beyond(polygon: Polygons, axis: int, sign: float, line: Floats) -> Polygons:
    """Return the parts where sign (coordinate - line) >= 0, with one corner more: the first one again where
    there are fewer (Sutherland and Hodgman)."""
    depth = sign * (polygon[axis] - line)
    after = np.roll(depth, -1, axis=0)
    crosses = depth * after < 0
    t = np.divide(depth, depth - after, out=np.zeros_like(depth), where=crosses)
    m, n = depth.shape
    count = np.zeros(n, dtype=np.int64)
    out = np.zeros((m + 1, n)), np.zeros((m + 1, n))
    for k in range(m):
        for kept, along in ((depth[k] >= 0, 0.0), (crosses[k], t[k])):
            who = np.flatnonzero(kept)
            at = count[who] * n + who
            for new, a in zip(out, polygon):
                new.put(at, (a[k] + along * (a[(k + 1) % m] - a[k]))[who])
            count[who] += 1
    missing = np.arange(m + 1)[:, None] >= count
    for new in out:
        new[:] = np.where(missing, new[0], new)
    return out
