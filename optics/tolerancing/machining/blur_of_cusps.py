"""The blur on the target that the cusps of a tool make, in pixels.

A pass of the tool adds slopes that range over a vector w (`thbcad.tools.Cusps`).  Light that crosses one pass
is spread over J w on the target, with the Jacobian J of the landing points by the slope, which holds Snell's
law at the ray and the way to the target: about L (n - 1) step / R for a ball of radius R.

This is geometrical optics: cusps also diffract light, into orders wavelength / step apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.scene.receivers import Screen
from optics.tolerancing.machining.response_to_slopes import Floats, LandingResponse
from optics.tolerancing.machining.tool_order import ToolOrder
from thbcad.splines import BSplineSurface
from thbcad.tools import Cusps, ball_cusps, nose_cusps


@dataclass(frozen=True, eq=False)
class CuspBlur:
    """Blur and cusps at rays on a surface, (n,) each; NaN where the tool does not fit.

    x, y : mm.  flux : of the rays.  pixels : whole width of the blur, for each mm of the step or feed
    heights : mm, of the cusps, for each mm^2 of the step or feed squared
    """

    x: Floats
    y: Floats
    flux: Floats
    pixels: Floats
    heights: Floats

    def worst(self) -> tuple[float, float, float]:
        """Return (pixels for each mm, x, y) of the greatest blur."""
        k = int(np.nanargmax(self.pixels))
        return float(self.pixels[k]), float(self.x[k]), float(self.y[k])

    @property
    def rms(self) -> float:
        """Root of the mean square over the light, pixels for each mm."""
        known = np.isfinite(self.pixels)
        return float(np.sqrt(np.average(self.pixels[known] ** 2, weights=self.flux[known])))

    @property
    def unknown(self) -> float:
        """Fraction of the light that crosses places where the tool does not fit."""
        return float(self.flux[~np.isfinite(self.pixels)].sum() / self.flux.sum())


def cusp_blur(graph: BSplineSurface, response: LandingResponse, screen: Screen, order: ToolOrder) -> CuspBlur:
    """Return the blur of a tool's cusps at rays.

    graph : of the surface, with air above it (`thbcad.tools.air_side`).  Slopes of cusps and blur grow with
    the step, heights with its square.
    """
    x, y = response.x, response.y
    cusps = cusps_of(graph, x, y, order, 1.0)
    moved = np.einsum("ijn,jn->in", response.jacobian, cusps.slopes)
    pitch = np.array([2 * h / n for h, n in zip(screen.half_width, screen.pixels)])
    return CuspBlur(x, y, response.flux, np.hypot(*(moved / pitch[:, None])), cusps.height)


def cusps_of(graph: BSplineSurface, x: Floats, y: Floats, order: ToolOrder, pitch: float) -> Cusps:
    """Return the cusps of an ordered tool at positions (n,) for a step or feed, mm."""
    if order.ball is not None:
        return ball_cusps(graph, x, y, order.ball, pitch, order.rows)
    assert order.nose is not None  # cusps are asked for of a tool
    return nose_cusps(graph, x, y, order.nose, pitch)
