"""Cells that the border of the light cuts: their quarters, and triangles along the border.

The border is the rim of a surface, or where total reflection begins.  Of a triangle P Q R with P on one side
of the border and Q, R on the other, the border meets the edges in U = P + u (Q - P) and V = P + v (R - P).
It is straight but for terms of second order in the triangle's size, so that the triangle falls into

    P U V,  u v of its area,    Q R V,  1 - v,    and    Q V U,  (1 - u) v.

u and v are bisected.  Each part takes the end of the last interval on its own side, so that all of its
corners are on that side.  Flux is shared in proportion to area and to the source's density in the middle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from thbcad.checks import Bools, Floats


@dataclass(frozen=True)
class Borders:
    """How well borders are followed.

    cells : across the source, as fine as cells that a border cuts become.
    bisections : of an edge of these.
    """

    cells: int
    bisections: int

    def coarser(self, times: int) -> Borders:
        """Return it for grids that are as much coarser."""
        return replace(self, cells=self.cells // times)


# beside a rim's four corners lies at most 4 / 2000^2 of the light; edges are cut to a millionth of them
FINEST = Borders(cells=2000, bisections=20)

Density = Callable[[Floats, Floats], Floats]


def shared_flux(flux: Floats, areas: Floats, middles: Floats, density: Density) -> Floats:
    """Return the flux of n wholes shared among m parts each, (m, n).

    Where the source is dark in the middle of all parts, they share by area alone.

    flux : (n,) W.  areas : (m, n), relative.  middles : (2, m, n), s and t.
    """
    densities = density(middles[0].ravel(), middles[1].ravel()).reshape(areas.shape)
    weights = areas * np.where(densities.any(axis=0), densities, 1.0)
    shared: Floats = flux * weights / weights.sum(axis=0)
    return shared


def border_triangles(
    pieces: Floats,
    arrive: Callable[[Floats, Floats], Bools],
    density: Density,
    bisections: int,
) -> tuple[Floats, Floats]:
    """Return corners (3, 2, m) and flux (m,) of triangles that make up rectangles, none cut by the border.

    The edge from the second to the third corner lies on an edge of a rectangle's triangles.

    pieces : (5, n), s and t of the lower and the upper corner of rectangles, and their flux.
    arrive : called with s and t, (k,) each, k > 0; returns whether the light from there arrives.
    density : of the source, up to a factor, called alike.  bisections : of edges, each a call of arrive.
    """
    s0, s1, t0, t1, flux = pieces
    corners = np.array([[s0, t0], [s0, t1], [s1, t0], [s1, t1]])
    inside = arrive(*_flat(corners)).reshape(4, -1)
    halves = np.stack([corners[[0, 2, 3]], corners[[0, 3, 1]]], axis=2)  # (3, 2, 2, n)
    flux = shared_flux(flux, np.ones((2, len(flux))), halves.mean(axis=0), density).ravel()
    corners = halves.reshape(3, 2, -1)
    inside = np.concatenate([inside[[0, 2, 3]], inside[[0, 3, 1]]], axis=1)
    count = inside.sum(axis=0)
    cut = (count == 1) | (count == 2)
    if not cut.any():
        return corners, flux
    alone = np.where(count == 1, inside.argmax(axis=0), inside.argmin(axis=0))
    order = (np.arange(3)[:, None] + alone) % 3
    turned = np.take_along_axis(corners, order[:, None, :], axis=0)
    parts, areas = _cut(turned[:, :, cut], (count == 1)[cut], arrive, bisections)
    shared = shared_flux(flux[cut], areas, parts.mean(axis=0), density)
    return (
        np.concatenate([corners[:, :, ~cut], parts.reshape(3, 2, -1)], axis=2),
        np.concatenate([flux[~cut], shared.ravel()]),
    )


def _cut(
    corners: Floats, first_inside: Bools, arrive: Callable[[Floats, Floats], Bools], bisections: int
) -> tuple[Floats, Floats]:
    """Return the three parts of triangles, corners (3, 2, 3, n), and their areas, (3, n), relative.

    corners : (3, 2, n).  first_inside : whether the light of the first corner arrives; the border separates
        it from the two others.
    """
    p, others = corners[0], corners[1:]
    near, far = np.zeros((2, p.shape[1])), np.ones((2, p.shape[1]))
    for _ in range(bisections):
        middle = (near + far) / 2
        inside = arrive(*_flat(p + middle[:, None] * (others - p))).reshape(near.shape)
        same = inside == first_inside
        near, far = np.where(same, middle, near), np.where(same, far, middle)
    (u, v), (q, r) = (near + far) / 2, others
    (near_u, near_v), (far_u, far_v) = (p + t[:, None] * (others - p) for t in (near, far))
    parts = [[near_u, p, near_v], [far_v, q, r], [far_v, q, far_u]]
    return np.array(parts).transpose(1, 2, 0, 3), np.array([u * v, 1 - v, (1 - u) * v])


def _flat(points: Floats) -> Floats:
    """Return s and t of points (k, 2, n) in two rows."""
    return np.moveaxis(points, 1, 0).reshape(2, -1)
