"""Where the light of a design goes, held in convex regions: source to front, front to rear, rear to target.

Light that leaves a source at most at the angle theta from z reaches the front within the source's figure
grown by (z - z_source) tan(theta).  In the glass its angle is at most asin(sin(theta) / n) behind a plane
front, and behind another one that of the light or of the front's normal, whichever is greater: Snell's law
makes the refracted direction a positive sum of both.  What leaves the rear is followed to the lit part of the
target.
"""

from dataclasses import dataclass
from math import asin, atan, inf, radians, sin, tan

import numpy as np

from optics.base.runtime import UserError
from optics.scene.receivers import Receiver
from optics.scene.system import System
from thbcad.certified import (
    DIRECTIONS,
    ConvexRegion,
    Stack,
    outline_supports,
    rectangle_supports,
    region_between,
    supports_of,
)
from thbcad.checks import Floats
from thbcad.lens import Lens, steepest
from thbcad.splines import BSplineSurface, KnotVector, tensor_apply

CELLS = 16  # of a surface in each direction, between which its heights are bounded
CONIC = 1e-11  # mm, of a conic from its spline
BEYOND = 1.0  # mm before and behind all of a part
GRID = 129  # points of a target in each direction
STEEPEST = 89.9  # degrees, beyond which light is taken to go everywhere


@dataclass(frozen=True, eq=False)
class LightHulls:
    """Regions that hold the light, by name, and what of front and rear is lit.

    regions : {"source to front": region, ...}; without a known light "front to rear" alone
    lit : {"front": supports, "rear": supports}, mm
    prisms : {"front": region, "rear": region}, all that lies above and below the lit figures
    target : supports of the lit part of the target in mm, of tangents in the far field; None is unknown
    exact : light passes everywhere in the hull of the glass
    """

    regions: dict[str, ConvexRegion]
    lit: dict[str, Floats]
    prisms: dict[str, ConvexRegion]
    target: Floats | None
    exact: bool


def light_hulls(lens: Lens, system: System | None, heights: tuple[float, float]) -> LightHulls:
    """Return the LightHulls of a lens in the light of a system, or in any light.

    heights : z of the lowest and the highest point of the part, mm.
    """
    full = {"front": outline_supports(lens.front.outline), "rear": outline_supports(lens.rear.outline)}
    sharp = lens.rear.outline.is_rectangle  # tangents round another one hold more than it
    whole = _surfaces(lens, full)
    if system is None:
        glass = region_between(whole["front"], whole["rear"])
        exact = lens.front.outline == lens.rear.outline and sharp
        return LightHulls({"front to rear": glass}, full, _prisms(full, heights), None, exact)
    low, high = heights[0] - BEYOND, heights[1] + BEYOND
    source, widest = system.source.envelope()
    up = [float(whole["front"].heights.max() - z) for z in (source.heights.min(), source.heights.max())]
    lit = {"front": np.minimum(full["front"], source.supports.max(axis=0) + _grown(widest, up[0]))}
    deep = float(whole["rear"].heights.max() - whole["front"].heights.min())
    inside = _grown(_inner_angle(lens, widest), deep)
    lit["rear"] = np.minimum(full["rear"], lit["front"] + inside)
    surfaces = _surfaces(lens, lit)
    source = Stack(source.heights, np.minimum(source.supports, lit["front"] + _grown(widest, up[0])))
    if system.source.from_afar:  # it comes from before all of the part
        back = min(low, float(source.heights.min()))
        source = Stack(np.array([back]), source.supports + _grown(widest, float(source.heights[0]) - back))
    if source.heights.max() < low < surfaces["front"].heights.min():
        source = source.towards(surfaces["front"], low)
    lit_target = _lit_target(system)
    ahead = _ahead(surfaces["rear"], system.target.receiver, lit_target, high)
    regions = {
        "source to front": region_between(source, surfaces["front"]),
        "front to rear": region_between(surfaces["front"], surfaces["rear"]),
        "rear to target": region_between(surfaces["rear"], ahead),
    }
    target = supports_of(np.tan(np.radians(lit_target)) if system.target.far_field else lit_target)
    return LightHulls(regions, lit, _prisms(lit, heights), target, system.parallel and sharp)


def _grown(degrees: float, along: float) -> float:
    """Return how far light at an angle from z goes aside, mm."""
    return inf if degrees > STEEPEST else max(along, 0.0) * tan(radians(degrees))


def _inner_angle(lens: Lens, widest: float) -> float:
    """Return the greatest angle of light from z behind the front, degrees.  widest : that before it."""
    if lens.front.is_plane:
        return float(np.degrees(asin(sin(radians(min(widest, 90.0))) / lens.index)))
    graph = lens.own_graphs()[0]
    slope = np.hypot(steepest(graph, 0), steepest(graph, 1))
    return max(widest, float(np.degrees(atan(slope))))


def _prisms(lit: dict[str, Floats], heights: tuple[float, float]) -> dict[str, ConvexRegion]:
    ends = heights[0] - BEYOND, heights[1] + BEYOND
    return {
        name: region_between(*(Stack(np.array([z]), supports[None]) for z in ends))
        for name, supports in lit.items()
    }


def _surfaces(lens: Lens, lit: dict[str, Floats]) -> dict[str, Stack]:
    faces = zip(lens.faces, lens.own_graphs())
    return {name: _lit_surface(graph, vertex, lit[name]) for (name, _, vertex), graph in faces}


def _lit_surface(graph: BSplineSurface, vertex: float, lit: Floats) -> Stack:
    """Return the lit part of a surface: its cells, each between the least and the greatest coefficient of the
    splines that are not zero there."""
    kvs, operators, ends = [], [], []
    for kv in (graph.kv_u, graph.kv_v):
        finer = kv.merge(KnotVector.uniform(kv.degree, CELLS, kv.start, kv.stop))
        kvs.append(finer)
        operators.append(kv.prolongation(finer))
        ends.append(np.linspace(kv.start, kv.stop, CELLS + 1))
    net = tensor_apply(operators[0], operators[1], graph.coefficients)
    (x, y), heights, supports = (row.tolist() for row in ends), [], []
    for i, j in np.ndindex(CELLS, CELLS):
        middle = (x[i] + x[i + 1]) / 2, (y[j] + y[j + 1]) / 2
        half = (x[i + 1] - x[i]) / 2, (y[j + 1] - y[j]) / 2
        cell = np.minimum(lit, DIRECTIONS @ middle + rectangle_supports(half))
        if (cell + np.roll(cell, len(cell) // 2) < 0).any():
            continue  # beside the light
        part = net[_active(kvs[0], x[i], x[i + 1]), _active(kvs[1], y[j], y[j + 1])]
        heights += [vertex + part.min() - CONIC, vertex + part.max() + CONIC]
        supports += [cell, cell]
    return Stack(np.array(heights), np.array(supports))


def _active(kv: KnotVector, low: float, high: float) -> slice:
    """Return the splines that are not zero somewhere between two parameters."""
    first = int(np.searchsorted(kv.knots[kv.degree + 1 :], low, side="right"))
    return slice(first, int(np.searchsorted(kv.knots[: kv.dim], high, side="left")))


def _lit_target(system: System) -> Floats:
    """Return corners of the rows of pixels that are to be lit, (n, 2), mm, in the far field degrees."""
    target = system.target
    screen = target.screen()
    lit = target.irradiance(screen, 1.0) > 0
    (x, y), (wide, tall) = screen.centres, np.divide(screen.pitch, 2)
    rows = np.flatnonzero(lit.any(axis=1))
    first, last = lit[rows].argmax(axis=1), lit.shape[1] - 1 - lit[rows, ::-1].argmax(axis=1)
    return np.concatenate(
        [
            np.stack([x[columns] + side * wide, y[rows] + up * tall], axis=1)
            for columns, side in ((first, -1), (last, 1))
            for up in (-1, 1)
        ]
    )


def _ahead(rear: Stack, receiver: Receiver, lit: Floats, high: float) -> Stack:
    """Return where light from the rear to the target ends: at the target, or behind all of the part.

    lit : corners of what is lit, (n, 2).
    """
    high = max(high, float(rear.heights.max()) + BEYOND)
    if receiver.far_field:
        x, y, z = receiver.toward((0.0, 0.0, 0.0), *lit.T)
        if (z <= 0).any():
            raise UserError("the light of a part goes towards +z; make target.tilt smaller")
        reached = rear.supports + (high - rear.heights)[:, None] * supports_of(
            np.stack([x / z, y / z], axis=1)
        )
        return Stack(np.array([high]), reached.max(axis=0)[None])
    if receiver.across_axis:
        z = float(receiver.pose.shift[2])
        screen = Stack(np.array([z]), supports_of(lit)[None])
        return screen if z <= high else rear.towards(screen, high)
    # a prism round all of what is lit: between its points a curved target bends by less than BEYOND
    low, top = lit.min(axis=0), lit.max(axis=0)
    grid = np.meshgrid(*np.linspace(low, top, GRID, axis=1))
    x, y, z = (a.ravel() for a in np.broadcast_arrays(*receiver.points(*grid)))
    around = supports_of(np.stack([x, y], axis=1)) + BEYOND
    ends = np.array([z.min() - BEYOND, z.max() + BEYOND])
    screen = Stack(ends, np.stack([around, around]))
    return screen if ends[1] <= high else rear.towards(screen, high)
