"""THB surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Bools, Floats, coordinates, locked, read_only, require_type, row
from thbcad.hierarchy import Cells, THBSpace, mesh_lines, space_rows
from thbcad.pictures import card, frame_size, interval_text, map_element, svg
from thbcad.splines import AnySurface, BSplineSurface
from thbcad.surfaces.level_patches import patches
from thbcad.surfaces.priced_faces import faces

STRIP = 1 << 18  # points that are evaluated at once
PIXELS = 112  # of the map, in u and in v: as a PNG at most 12.7 kB, and 16.9 kB of text


@dataclass(frozen=True, eq=False)
class THBSurface(AnySurface):
    """The spline sum_f c_f T_f(u, v) over the truncated functions T_f of a THB space, with coefficients
    (dim,) or (dim, d).  Over a tensor-product space, nets (n_u, n_v) or (n_u, n_v, d) are taken, too.

    Raises ValueError : a space that is no THBSpace; coefficients of another shape, or not finite.

    >>> kv = KnotVector.uniform(degree=3, spans=4)
    >>> surface = quasi_interpolate(THBSpace(kv, kv), lambda u, v: u**3 * v)
    >>> finer = surface.refine({0: [(1, 1)]})  # the same surface
    >>> np.allclose([surface(0.3, 0.4), finer(0.3, 0.4)], 0.3**3 * 0.4, rtol=1e-13)
    True
    """

    space: THBSpace
    coefficients: Floats

    def __init__(self, space: THBSpace, coefficients: ArrayLike) -> None:
        require_type("space", space, THBSpace)
        c, dim = read_only(coefficients), space.dim
        if space.levels == 1 and c.shape[:2] == (space.kv_u.dim, space.kv_v.dim) and c.ndim < 4:
            c = locked(c.reshape(dim, *c.shape[2:]))
        if c.shape[:1] != (dim,) or c.ndim > 2 or c.size == 0:
            raise ValueError(f"coefficients must have shape ({dim},) or ({dim}, d), got {c.shape}")
        if not np.isfinite(c).all():
            raise ValueError("coefficients must be finite")
        vars(self).update(space=space, coefficients=c)

    def __repr__(self) -> str:
        rest = self.coefficients.shape[1:]
        values = f"points in {rest[0]} dimensions" if rest else "scalar coefficients"
        return f"THBSurface(of {self.space!r}, {values})"

    def _repr_html_(self) -> str:
        """Return a map of the values with the mesh, and some numbers, for notebooks."""
        return _card(self)

    @cached_property
    def _tensor(self) -> BSplineSurface:
        embedding = self.space.embedding
        return BSplineSurface(embedding.kv_u, embedding.kv_v, embedding.coefficients(self.coefficients))

    @cached_property
    def _local(self) -> Floats:
        """Local coefficients of the leaf cells, (cells, p + 1, q + 1, ...)."""
        nets = np.concatenate(list(self.space.nets.coefficients(self.coefficients)))
        result: Floats = nets[self.space.local_basis.blocks]
        return result

    def to_bspline(self) -> BSplineSurface:
        """Return the same surface as one tensor-product B-spline with only the knots needed.

        Raises ValueError : it needs more than 10^8 control points.
        """
        return self._tensor

    def __call__(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return the values at points (u, v), in the shape to which u and v broadcast, and (..., d) of
        coefficients (dim, d).

        Raises ValueError : as `BSplineSurface`.
        """
        if self.space.is_compact:
            return self._tensor(u, v, derivative)
        u, v = coordinates(u=(u, self.space.kv_u.domain), v=(v, self.space.kv_v.domain))
        values = self._cellwise(u.ravel(), v.ravel(), derivative)
        return values.reshape((*u.shape, *values.shape[1:]))[()]

    def grid(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return the values on the grid u x v, (len(u), len(v)) or (len(u), len(v), d).

        Raises ValueError : parameters outside the domain or NaN, an order that is not a non-negative integer.
        """
        if self.space.is_compact:
            return self._tensor.grid(u, v, derivative)
        u, v = row("u", u), row("v", v)
        values = self._cellwise(np.repeat(u, len(v)), np.tile(v, len(u)), derivative)
        return values.reshape(len(u), len(v), *values.shape[1:])

    def _cellwise(self, u: Floats, v: Floats, derivative: tuple[int, int]) -> Floats:
        """Return the values at scattered points from the local coefficients of their cells, (n,) or (n,
        d)."""
        strips = []
        for first in range(0, max(len(u), 1), STRIP):
            strip = slice(first, first + STRIP)
            by_u, by_v, cell = self.space.local_values(u[strip], v[strip], derivative)
            # the path that einsum finds for any number of points, the longer sum first
            path = ["einsum_path", (0, 2) if by_u.shape[1] >= by_v.shape[1] else (1, 2), (0, 1)]
            strips.append(np.einsum("ka,kb,kab...->k...", by_u, by_v, self._local[cell], optimize=path))
        return np.concatenate(strips)

    def to_patches(self) -> list[BSplineSurface]:
        """Return the same surface as the fewest clamped B-spline patches over rectangles of same-level
        cells."""
        return [BSplineSurface(*patch) for patch in patches(self.space, self.coefficients)]

    def bernstein(self) -> Floats:
        """Return the Bernstein coefficients on every leaf cell, (cells, p + 1, q + 1) or (cells, p + 1, q +
        1, d).

        On leaf cell k, over ``space.boxes[k]``, the surface is sum_ij B_i^p(s) B_j^q(t) b_kij with s and t
        in [0, 1] along u and v.
        """
        return self.space.local_basis.bernstein(self._local)

    def to_faces(self, price: float) -> list[BSplineSurface]:
        """Return the same surface as faces on only the knots that each needs, between one face and many.

        price : how many control points a face is worth; 0 gives the fewest control points that
            bisection finds, inf one face.

        Raises ValueError : a price that is negative or NaN; a tensor-product form of more than 10^8 control
            points.
        """
        return list(faces(self.space, self._tensor, price))

    def refine(self, cells: Cells, admissible: int | None = None) -> THBSurface:
        """Return the same surface over ``space.refine(cells, admissible)``."""
        return self._over(self.space.refine(cells, admissible))

    def uniform(self, level: int) -> THBSurface:
        """Return the same surface over ``space.uniform(level)``."""
        return self._over(self.space.uniform(level))

    def integral(self) -> np.float64 | Floats:
        """Return the integral over the domain, exact: on a cell its size times the mean of the Bernstein
        coefficients."""
        u0, u1, v0, v1 = self.space.boxes.T
        return np.tensordot((u1 - u0) * (v1 - v0), self.bernstein().mean(axis=(1, 2)), axes=1)[()]

    def area(self) -> tuple[float, float]:
        """Return the area, of a scalar surface that of its graph (u, v, z), and an estimate of its error: the
        sums over `to_patches`."""
        values, errors = zip(*(patch.area() for patch in self.to_patches()))
        return sum(values), sum(errors)

    def _cells(self) -> tuple[Floats, Floats]:
        return self.bernstein(), self.space.boxes.reshape(-1, 2, 2).transpose(0, 2, 1)

    def _over(self, finer: THBSpace) -> THBSurface:
        return THBSurface(finer, self.space.prolongation(finer) @ self.coefficients)


def _card(surface: THBSurface) -> str:
    """Return a map of the values beside the numbers of a surface, as HTML of at most 40 kB."""
    size = frame_size(*(kv.stop - kv.start for kv in (surface.space.kv_u, surface.space.kv_v)))
    picture, values, drawn = value_map(surface, size)
    rows = [
        *space_rows(surface.space, surface.space.dim, drawn),
        ("values", interval_text(values.min(), values.max())),
    ]
    if surface.coefficients.ndim == 2:
        rows.insert(0, ("components", f"{surface.coefficients.shape[1]}, the last of them shown"))
    return card("THBSurface", svg(picture, *size), rows)


def value_map(
    surface: THBSurface, size: tuple[float, float], inside: Callable[[Floats, Floats], Bools] | None = None
) -> tuple[str, Floats, int]:
    """Return (SVG elements, the values on them (columns, rows), levels of the mesh on them).

    Of vectors the last component is shown; u runs to the right and v upwards.

    size : width and height in pixels
    inside : function of positions (x, y) from -1 to 1 that returns which count; the values are then those
        inside, (n,), and have all the colours
    """
    part = (np.arange(PIXELS) + 0.5) / PIXELS
    u, v = (kv.start + (kv.stop - kv.start) * part for kv in (surface.space.kv_u, surface.space.kv_v))
    values = surface.grid(u, v)
    if values.ndim == 3:
        values = values[..., -1]
    shown = values if inside is None else values[inside(2 * part[:, None] - 1, 2 * part - 1)]
    lines, drawn = mesh_lines(surface.space, *size)
    return map_element(np.clip(values, shown.min(), shown.max()), *size) + lines, shown, drawn
