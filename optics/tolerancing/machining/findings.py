"""Whether a tool fits a lens, what its cusps do to the light, and how its machine must move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import atan, ceil, degrees

import numpy as np

from optics.base.runtime import Backend, Check, UserError
from optics.light.blur import spot_width
from optics.scene.system import System, require_lens_on_axis
from optics.tolerancing.machining.blur_of_cusps import (
    CuspBlur,
    CuspLight,
    Floats,
    cusp_blur,
    cusps_of,
    landing_response,
    light_with_cusps,
)
from optics.tolerancing.machining.tool_order import SPEED, ToolOrder
from thbcad.certified import Enclosure
from thbcad.outlines import Outline
from thbcad.splines import BSplineSurface
from thbcad.tools import (
    SURFACES,
    Draft,
    Fit,
    Gaps,
    SpiralCut,
    acceleration_at,
    air_side,
    ball_fit,
    draft,
    greatest_acceleration,
    greatest_slope_along_cut,
    highest_rpm,
    nose_fit,
    rim_gaps,
)

RAYS = 257  # in each direction: a map finer than a picture shows
ANYWHERE = 257  # points in each direction, on the rim too
OF_BLUR = 0.5  # of the blur without cusps: both together are wider by an eighth
RISE = 0.01  # of rel_l2 by cusps that need no polishing: that of tolerances where nothing else is said
FINER = 4  # steps that are tried for one whose cusps raise rel_l2 by less
ROUND_DOWN = 1 - 1e-14  # below the roundings of an arctangent and a product


@dataclass(frozen=True, eq=False)
class SpiralMotion:
    """A slow tool servo on one surface.

    cut : the spiral.  kernel : mm, greatest |z''| / omega^2 over the lens, certified
    gaps : the tool beside the lens, sampled; None of a round lens, which it never leaves
    clearance : degrees, least clearance angle, certified
    """

    cut: SpiralCut
    kernel: Enclosure
    gaps: Gaps | None
    clearance: Enclosure

    @property
    def greatest(self) -> float:
        """The greatest |z''| / omega^2 over lens and gaps, mm."""
        return max(self.kernel.upper, self.gaps.worst()[0] if self.gaps else 0.0)

    def acceleration(self, rpm: float) -> float:
        """Return the greatest acceleration over lens and gaps, m/s^2."""
        return acceleration_at(rpm, self.greatest)

    def highest_rpm(self, limit: float) -> float:
        """Return the revolutions for each minute that keep a limit in m/s^2 over lens and gaps."""
        return highest_rpm(limit, self.greatest)


@dataclass(frozen=True)
class RowCut:
    """A ball on a surface, row by row.  rows : how many.  length : m, of all rows.  hours : of one pass."""

    rows: int
    length: float
    hours: float


@dataclass(frozen=True, eq=False)
class SurfaceFindings:
    """A tool on one surface.

    graph : with air above it.  blur : None where the tool fits nowhere.  pitch : mm, step or feed
    yardstick : pixels, half of the blur that there is without cusps, at least one.
    height_anywhere : mm, of cusps on the whole surface for each mm^2 of the pitch squared, sampled; NaN where
        the tool fits nowhere.
    light : with the cusps; None where it is unknown.
    finer : a smaller step or feed, mm, and by how much its cusps raise rel_l2; None where those of `pitch`
        raise it by RISE at most, or none was found.  motion : of a nose that fits, else None
    rows : of a ball
    """

    name: str
    graph: BSplineSurface
    fit: Fit
    blur: CuspBlur | None
    pitch: float | None
    yardstick: float
    height_anywhere: float
    light: CuspLight | None
    finer: tuple[float, float] | None
    motion: SpiralMotion | None
    rows: RowCut | None

    @property
    def cusp_height(self) -> float:
        """The greatest height of cusps where light for the target crosses, mm; NaN where it is unknown."""
        if self.blur is None or self.pitch is None:
            return float("nan")
        return float(np.nanmax(self.blur.heights)) * self.pitch**2

    @property
    def largest_pitch(self) -> float | None:
        """The step or feed, mm, whose cusps blur by the yardstick at most; None where blur is unknown."""
        return None if self.blur is None else self.yardstick / self.blur.worst()[0]

    @property
    def rise(self) -> float:
        """By how much cusps raise rel_l2; 0 where that is unknown."""
        return 0.0 if self.light is None else self.light.with_cusps - self.light.without

    @property
    def polish(self) -> bool | None:
        """Whether cusps blur the light by more than the yardstick, or raise rel_l2 by more than RISE.

        None where that is unknown.
        """
        if self.pitch is None or self.largest_pitch is None:
            return None
        return self.pitch > self.largest_pitch or self.rise > RISE


@dataclass(frozen=True, eq=False)
class ToolFindings:
    """What was found of a tool on a lens; checks fail where it is not proven to fit, or moves too hard.

    draft : of the lens; its walls are left out where a body or a plate has others.
    body_draft : degrees, of the walls of such a body.  lenses : of the plate, of each of which this holds.
    """

    order: ToolOrder
    surfaces: tuple[SurfaceFindings, ...]
    draft: Draft
    body_draft: float | None = None
    lenses: int = 1

    @property
    def checks(self) -> list[Check]:
        """By how much the tool may be too large, and the acceleration too great."""
        checks = []
        for s in self.surfaces:
            name = f"{self.order.words} on the {s.name}: radius beyond the least concave radius"
            checks.append(Check(name, max(0.0, s.fit.tool - s.fit.least.lower), 0, "mm"))
            limit, rpm = self.order.acceleration, self.order.rpm
            if s.motion is not None and rpm is not None and limit is not None:
                name = f"acceleration of the tool on the {s.name} at {rpm:g} rpm"
                checks.append(Check(name, s.motion.acceleration(rpm), limit, "m/s^2"))
        return checks


def tool_findings(system: System, order: ToolOrder, backend: Backend, rays: int = RAYS) -> ToolFindings:
    """Return what a tool does on a lens.

    rays : in each direction, by which the blur is mapped.

    Raises UserError : no lens on the axis; a nose on a plate.
    """
    lens = system.designed
    require_lens_on_axis(system, "tools", "export its solid for the program of the machine")
    array, body = system.problem.optic.array, system.body
    if array is not None and order.spiral:
        raise UserError("a nose on a spiral turns one lens, and this is a plate of lenses; take a ball")
    names = [order.surface] if order.surface else [n for n in SURFACES if not getattr(lens, n).is_plane]
    if order.radius is None:
        names = []
    pixel = float(np.mean(system.target.screen().pitch))
    yardstick = max(1.0, OF_BLUR * spot_width(system, backend) / pixel) if names else 1.0
    surfaces = tuple(_surface(system, order, backend, name, rays, yardstick) for name in names)
    found = draft(lens) if array is None and body is None else replace(draft(lens), walls=())
    lenses, body_draft = 1 if array is None else array.count, None if body is None else body.draft
    return ToolFindings(order, surfaces, found, body_draft, lenses)


def _surface(
    system: System, order: ToolOrder, backend: Backend, name: str, rays: int, yardstick: float
) -> SurfaceFindings:
    lens = system.designed
    graph, radius, outline = air_side(lens, name), order.radius, getattr(lens, name).outline
    assert radius is not None  # surfaces are looked at for a tool
    fit = nose_fit(graph, radius, _turned(outline)) if order.spiral else ball_fit(graph, radius, outline)
    response = landing_response(system, backend, name, rays)
    blur = cusp_blur(graph, response, system.target.screen(), order) if len(response.x) else None
    if blur is not None and blur.unknown == 1:
        blur = None
    pitch = order.pitch
    if pitch is None and blur is not None:
        pitch = yardstick / blur.worst()[0]
    light = finer = None
    if blur is not None and pitch is not None and not blur.unknown:

        def cut_light(pitch: float) -> CuspLight | None:
            def slopes(x: Floats, y: Floats) -> Floats:
                return np.nan_to_num(cusps_of(graph, x, y, order, pitch).slopes)

            return light_with_cusps(system, backend, name, slopes, pitch * blur.worst()[0])

        light = cut_light(pitch)
        finer = _finer_pitch(cut_light, pitch, light)
    turns = order.spiral and fit.proven
    motion = spiral_motion(graph, outline, radius, pitch) if turns and pitch is not None else None
    rows = None if order.spiral or pitch is None else row_cut(graph, outline, order, pitch)
    # the greatest height of cusps all over a surface for a pitch of 1 mm, mm; NaN where none fits
    heights = cusps_of(graph, *_grid(outline), order, 1.0).height
    anywhere = float(np.nanmax(heights)) if np.isfinite(heights).any() else float("nan")
    return SurfaceFindings(name, graph, fit, blur, pitch, yardstick, anywhere, light, finer, motion, rows)


def _finer_pitch(
    cut_light: Callable[[float], CuspLight | None], pitch: float, light: CuspLight | None
) -> tuple[float, float] | None:
    """Return a step or feed whose cusps raise rel_l2 by at most RISE, and by how much; None if not needed."""
    for _ in range(FINER):
        rise = 0.0 if light is None else light.with_cusps - light.without
        if rise <= RISE:
            break
        pitch = float(f"{pitch * min(0.95 * RISE / rise, 0.5):.3g}")
        light = cut_light(pitch)
        if light is not None and light.with_cusps - light.without <= RISE:
            return pitch, light.with_cusps - light.without
    return None


def _grid(outline: Outline) -> tuple[Floats, Floats]:
    """Return x and y of points all over a surface, on the rim of a rectangle too, (n,) each."""
    x, y = np.meshgrid(*(np.linspace(-h, h, ANYWHERE) for h in outline.half_width))
    inside = outline.contains(x, y)
    return x[inside], y[inside]


def _turned(outline: Outline) -> Outline | None:
    """Return over what a nose on a spiral cuts: a disk; else the whole rectangle, where the graph goes on."""
    x, y = outline.half_width
    return outline if outline.is_ellipse and x == y else None


def row_cut(graph: BSplineSurface, outline: Outline, order: ToolOrder, step: float) -> RowCut:
    """Return the rows of a ball over a surface, along its slopes, and the hours at its speed."""
    x, y = _grid(outline)
    along, across = (graph.kv_u, graph.kv_v) if order.rows == "x" else (graph.kv_v, graph.kv_u)
    slope = graph(x, y, (1, 0) if order.rows == "x" else (0, 1))
    rows = ceil((across.stop - across.start) / step) + 1
    share = 1.0 if outline.is_rectangle else outline.area / float(4 * np.prod(outline.half_width))
    length = rows * (along.stop - along.start) * float(np.sqrt(1 + slope**2).mean()) * share
    return RowCut(rows, length / 1e3, length / (order.speed or SPEED) / 60)


def spiral_motion(graph: BSplineSurface, outline: Outline, nose: float, feed: float) -> SpiralMotion:
    """Return the motion of a nose that fits, on a spiral with a feed for each revolution, mm."""
    cut, disk = SpiralCut.over(outline.half_width, feed, outline.corners), _turned(outline)
    kernel = greatest_acceleration(graph, nose, cut.advance, outline=disk)
    # the least clearance angle: the arctangent of the greatest slope along the cut, degrees
    slope = greatest_slope_along_cut(graph, outline=disk)
    lower, value, upper = (degrees(atan(s)) for s in (slope.lower, slope.value, slope.upper))
    clearance = replace(slope, lower=lower * ROUND_DOWN, value=value, upper=upper / ROUND_DOWN)
    gaps = rim_gaps(graph, nose) if disk is None else None
    return SpiralMotion(cut, kernel, gaps, clearance)
