"""Whether a round tool fits everywhere on a lens: its radius against certified least concave radii.

A ball of radius R that touches a graph from above cuts nowhere into it when every principal curvature is
below 1/R.  For let F(d) = z(p + d) + sqrt(R^2 - |d|^2), whose maximum over the disc is the height of the
ball's centre over p.  Where its gradient vanishes ball and graph have one tangent plane, and the ball bends
more: every such point is a strict maximum.  At the rim of the disc the gradient points inward.  Two maxima
would have a saddle between them (mountain pass); so there is one, the point of contact.

The same holds for a nose in a plane through the axis, for the curvature of the section in that plane.  It
holds for positions whose disc lies over the graph; what stands beyond its rim is not known here.

Source: W. Blaschke, Kreis und Kugel, section 24; M. Struwe, Variational Methods, chapter II.
"""

from dataclasses import dataclass

import numpy as np

from thbcad.certified import Enclosure, least_radii, reciprocal
from thbcad.checks import Floats, require_number, shown
from thbcad.lens import Lens
from thbcad.outlines import Outline
from thbcad.splines import BSplineSurface
from thbcad.tools.spiral_bounds import greatest_section_curvature
from thbcad.tools.spiral_motion import DERIVATIVES, round_axis

SURFACES = ("front", "rear")
RADII = 1e-4  # relative tolerance: 0.3 um of 3 mm, finer than tools are ground


@dataclass(frozen=True)
class Fit:
    """A tool of a radius, mm, against the least radius that it must not exceed."""

    tool: float
    least: Enclosure

    @property
    def proven(self) -> bool:
        """Whether the tool fits for certain."""
        return self.tool <= self.least.lower

    @property
    def refuted(self) -> bool:
        """Whether the tool does not fit for certain."""
        return self.tool > self.least.upper


def air_side(lens: Lens, name: str) -> BSplineSurface:
    """Return the "front" or the "rear" as a graph whose air lies above it: of a front, -z over x and y.

    Raises ValueError : another name, graphs that a lens has not (see `Lens.graphs`).
    """
    if name not in SURFACES:
        raise ValueError(f"a lens has the surfaces front and rear, got {shown(name)}")
    front, rear = lens.own_graphs()
    return rear if name == "rear" else BSplineSurface(front.kv_u, front.kv_v, 0.0 - front.coefficients)


def ball_fit(graph: BSplineSurface, radius: float, outline: Outline | None = None) -> Fit:
    """Return a ball end against the certified least concave radius of a graph with air above it.

    outline : Outline or None, only points inside count

    Raises ValueError : a radius that is not positive, degree 1, a graph that is not scalar.
    """
    require_number("the radius of a ball", radius, above=0, finite=True)
    return Fit(float(radius), least_radii(graph, RADII, outline).concave)


def nose_fit(graph: BSplineSurface, radius: float, outline: Outline | None = None) -> Fit:
    """Return a nose that cuts on a spiral round x = y = 0 against the sections through that axis.

    outline : Outline or None, only points inside count

    Raises ValueError : as `ball_fit`.
    """
    require_number("the radius of a nose", radius, above=0, finite=True)
    return Fit(float(radius), reciprocal(greatest_section_curvature(graph, outline=outline)))


def concavity(graph: BSplineSurface, x: Floats, y: Floats, spiral: bool) -> Floats:
    """Return the concave curvature that a tool must follow at positions, (n,), 1/mm; below 0 it is convex.

    spiral : that of the section through the axis x = y = 0, which a nose follows; else the greatest in any
    direction, which a ball follows.
    """
    if spiral:
        at = round_axis(graph, x, y)
        return np.asarray(at.bend / (1 + at.slope**2) ** 1.5)
    z_x, z_y, z_xx, z_xy, z_yy = (graph(x, y, orders) for orders in DERIVATIVES)
    square = 1 + z_x**2 + z_y**2
    mean = ((1 + z_y**2) * z_xx - 2 * z_x * z_y * z_xy + (1 + z_x**2) * z_yy) / (2 * square**1.5)
    gauss = (z_xx * z_yy - z_xy**2) / square**2
    return np.asarray(mean + np.sqrt(np.maximum(mean**2 - gauss, 0)))
