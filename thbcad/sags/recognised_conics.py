"""Conics of revolution about z, found in the numbers of planes, spheres and rational patches of files."""

from math import hypot

import numpy as np

from thbcad.checks import Floats
from thbcad.sags.conic import Conic
from thbcad.sags.placed_conic import NOT_BOUNDED, PlacedConic, patch_numbers
from thbcad.splines import NURBSSurface

SAME = 1e-12  # relative: rounding of some operations


def rectangle_around(corners: Floats) -> tuple[float, float]:
    """Return the half-widths in mm of the rectangle around x = y = 0 with these corners, infinite ones where
    they are not the corners of such a rectangle.

    corners : (n, 3) or (n, 2) float, in any order, also several times
    """
    apart = abs(corners[:, :2])
    if not len(apart):
        return NOT_BOUNDED
    x, y = apart.max(axis=0).tolist()
    quadrants = {tuple(row) for row in np.sign(corners[:, :2]).tolist()}
    whole = len(quadrants) == 4 and bool((abs(apart - [x, y]) <= SAME * max(x, y)).all())
    return (x, y) if whole and min(x, y) > 0 else NOT_BOUNDED


def conic_of_plane(placement: Floats, half_width: tuple[float, float] = NOT_BOUNDED) -> PlacedConic | None:
    """Return the plane with a point, normal and first direction, (3, 3), mm; None unless it is normal to
    z."""
    point, normal, _ = placement
    if hypot(normal[0], normal[1]) > SAME * abs(normal[2]):
        return None
    return PlacedConic(Conic(), float(point[2]), half_width, placement.ravel())


def conic_of_sphere(
    placement: Floats, radius: float, below: bool, half_width: tuple[float, float] = NOT_BOUNDED
) -> PlacedConic | None:
    """Return the part of a sphere below or above its centre; None unless the centre lies on z.

    placement : centre, axis and first direction, (3, 3).  radius : mm
    """
    centre = placement[0]
    if hypot(centre[0], centre[1]) > SAME * radius:
        return None
    signed = radius if below else -radius
    numbers = np.append(placement, radius)
    return PlacedConic(Conic(signed, 0.0), float(centre[2] - signed), half_width, numbers)


def conic_of_patch(
    surface: NURBSSurface, half_width: tuple[float, float] = NOT_BOUNDED
) -> PlacedConic | None:
    """Return the conic of which a surface is the patch of `PlacedConic.patch`; None of other surfaces.

    With homogeneous poles (x, y, z, w) at a corner (0) and in the middle (m): 1 = (w_0 + w_m) / 2,
    vertex = (z_0 + z_m) / 2, kappa = (w_0 - w_m) / (2 q), 1 / R = (z_0 - z_m - vertex (w_0 - w_m)) / q,
    q = x_0^2 + y_0^2, K = 4 R^2 kappa - 1.
    """
    net = surface.homogeneous.coefficients
    if net.shape != (3, 3, 4) or surface.kv_u.degree != 2 or surface.kv_v.degree != 2:
        return None
    net = 2 * net / (net[0, 0, 3] + net[1, 1, 3])
    corner, middle = net[0, 0], net[1, 1]
    square = corner[0] ** 2 + corner[1] ** 2
    vertex = (corner[2] + middle[2]) / 2
    fall = corner[3] - middle[3]
    curvature = (corner[2] - middle[2] - vertex * fall) / square
    kappa = fall / (2 * square)
    if not (np.isfinite(curvature) and curvature and kappa):
        return None
    found = _patch_net(corner, vertex, curvature, kappa)
    if not (abs(found - net) <= SAME * abs(net).max()).all():
        return None
    conic = Conic(float(1 / curvature), float(4 * kappa / curvature**2 - 1))
    return PlacedConic(conic, float(vertex), half_width, patch_numbers(surface))


def _patch_net(corner: Floats, vertex: float, curvature: float, kappa: float) -> Floats:
    """Return the homogeneous poles of the patch up to a corner, (3, 3, 4)."""
    s, t = np.multiply.outer(-corner[:2], [-1.0, 0.0, 1.0])
    squares = np.multiply.outer(corner[:2] ** 2, [1.0, -1.0, 1.0])
    x, y = np.broadcast_arrays(s[:, None], t[None, :])
    q = squares[0][:, None] + squares[1][None, :]
    w = 1 + kappa * q
    return np.stack([x, y, vertex * w + q * curvature / 2, w], axis=-1)
