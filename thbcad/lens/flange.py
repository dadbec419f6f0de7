"""Planar mounting flanges: what they must keep clear of, and the volume of a lens with one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thbcad.certified import value_range
from thbcad.checks import require_number, require_type
from thbcad.lens.cuts import aperture_volume, require_aperture
from thbcad.lens.lens import Lens
from thbcad.lens.rims import SIDES, rim, ruled_edges
from thbcad.outlines import LEAST_SIZE, Ellipse, rim_curve
from thbcad.splines import UNIT, BSplineSurface, gauss_rule

NODES = 16  # of the Gauss rule on every span; its error falls by a factor per node


@dataclass(frozen=True)
class Flange:
    """A flange between the planes z = low and z = high that extends `width` beyond the lens on all sides.

    Its outline is a rectangle with half-widths, or an ellipse with semi-axes, that are `width` greater
    than those of the lens; of surfaces of different size the greater half-widths count.

    width, low, high : float, mm; z = 0 is the vertex of the front

    Raises
    ------
    ValueError : numbers that are not finite; a width or a thickness high - low below 1e-6 mm.
    """

    width: float
    low: float
    high: float

    def __post_init__(self) -> None:
        for name, least in (("width", LEAST_SIZE), ("low", -np.inf), ("high", -np.inf)):
            require_number(f"flange {name}", getattr(self, name), least=least, finite=True)
            object.__setattr__(self, name, float(getattr(self, name)))
        if self.high - self.low < LEAST_SIZE:
            raise ValueError(
                f"flange high must be at least {LEAST_SIZE:g} mm above flange low = {self.low:.9g} mm, got "
                f"{self.high:.9g} mm"
            )

    def rectangle(self, lens: Lens) -> tuple[float, float]:
        """Return the half-widths of the outline round a rectangular lens, mm."""
        a, b = (max(pair) + self.width for pair in zip(lens.front.half_width, lens.rear.half_width))
        return a, b

    def ellipse(self, aperture: Ellipse) -> Ellipse:
        """Return the outline round a lens with an elliptic aperture."""
        a, b = aperture.semi_axes
        return Ellipse((a + self.width, b + self.width))


def require_clear(lens: Lens, flange: Flange, semi_axes: tuple[float, float] | None = None) -> None:
    """Refuse a flange that meets front or rear: the front's rim must lie below it, the rear's rim above it.

    The heights of the rims are certified on the rectangle; round an aperture, those of the rim's splines are
    (`fitted_curve`).

    Raises
    ------
    ValueError : no Flange; no Lens; as `require_aperture`; a rim less than 1e-6 mm away from the flange.
    """
    require_type("flange", flange, Flange)
    require_type("lens", lens, Lens)
    front, rear = lens.graphs()
    top = max(value_range(curve)[1].upper for curve in _rims(front, lens, semi_axes))
    bottom = lens.thickness + min(value_range(curve)[0].lower for curve in _rims(rear, lens, semi_axes))
    if flange.low < top + LEAST_SIZE:
        raise ValueError(
            f"flange low must lie above the front's rim, which reaches up to z = {top:.9g} mm, got "
            f"{flange.low:.9g} mm"
        )
    if flange.high > bottom - LEAST_SIZE:
        raise ValueError(
            f"flange high must lie below the rear's rim, which reaches down to z = {bottom:.9g} mm, got "
            f"{flange.high:.9g} mm"
        )


def _rims(graph: BSplineSurface, lens: Lens, semi_axes: tuple[float, float] | None) -> list[BSplineSurface]:
    """Return the heights of a rim, curve by curve, as graphs that are constant in their second parameter."""
    if semi_axes is None:
        curves = [rim(graph, side) for side in SIDES]
    else:
        ellipse = require_aperture(lens, semi_axes)
        curves = [(kv, poles[:, 2]) for kv, poles in (rim_curve(graph, ellipse, half) for half in (0, 1))]
    return [BSplineSurface(kv, UNIT, np.stack([z, z], axis=1)) for kv, z in curves]


def flanged_volume(lens: Lens, flange: Flange, semi_axes: tuple[float, float] | None = None) -> float:
    """Return the volume of a lens with a flange, mm^3.

    V = V_lens + (high - low) A_outline - V_inside, V_inside the part of the lens between the planes.

    semi_axes : of an elliptic aperture, mm; None is the rectangular lens.

    Raises
    ------
    ValueError : as `require_clear`.
    """
    require_clear(lens, flange, semi_axes)
    depth = flange.high - flange.low
    if semi_axes is not None:
        aperture = Ellipse(semi_axes)
        return aperture_volume(lens, semi_axes) + depth * (flange.ellipse(aperture).area - aperture.area)
    a, b = flange.rectangle(lens)
    return lens.volume() + 4 * a * b * depth - _inside(lens, flange)


def _inside(lens: Lens, flange: Flange) -> float:
    """Return the volume of a rectangular lens between two planes that meet only its edges.

    By Stokes' theorem it is the integral of (x dy - y dx) dz / 2 over the edges (s, v) between the planes.
    """
    total = 0.0
    for side, edge in zip(SIDES, ruled_edges(lens)):
        sign = -1 if side.clockwise else 1
        s, weights = gauss_rule(edge.kv_u.breaks, NODES)
        (front, rear), (slope, other) = (np.moveaxis(edge.grid(s, [0.0, 1.0], (d, 0)), 1, 0) for d in (0, 1))
        low, high = ((z - front[:, 2]) / (rear - front)[:, 2] for z in (flange.low, flange.high))
        for fraction, weight in zip(*gauss_rule(np.array([0.0, 1.0]), 2)):
            v = (low + fraction * (high - low))[:, None]
            point = front + v * (rear - front)
            along = slope + v * (other - slope)
            up = rear - front
            x, y, _ = point.T
            form = (x * along[:, 1] - y * along[:, 0]) * up[:, 2] - (x * up[:, 1] - y * up[:, 0]) * along[
                :, 2
            ]
            total += sign * weight * float((weights * (high - low)) @ form) / 2
    return total
