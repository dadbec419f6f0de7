"""Tools on the pearl lens: how tight certified bounds are, and the blur of cusps against an exact trace.

Run: thbcad bench tools
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import EXAMPLES
from benchmarks.rows.row import Row
from optics.base.runtime import Backend, load_backend
from optics.interface.api import design
from optics.scene.problem import load_problem
from optics.scene.system import System
from optics.tolerancing.machining import (
    CuspBlur,
    ToolOrder,
    cusp_blur,
    landing_response,
    light_with_cusps,
    tool_findings,
    traced_points,
)
from thbcad import BSplineSurface, Enclosure
from thbcad.tools import (
    air_side,
    ball_cusps,
    ball_fit,
    concavity,
    greatest_acceleration,
    greatest_slope_along_cut,
    nose_fit,
    round_axis,
    tool_acceleration,
)

Floats = NDArray[np.float64]

NOSE, ADVANCE = 1.0, 0.005 / (2 * np.pi)  # mm, mm for each radian
BALL, STEP = 6.0, 0.1  # mm: cusps of a fifth of a micrometre
SMALL_BALL = 3.0  # mm: fits the pearl's rear
DENSE = 1500  # samples in each direction, beside which bounds are held
RAYS = 129  # in each direction, of the comparison with the exact trace


def rows() -> list[Row]:
    """Return the measured rows."""
    system = System(load_problem(EXAMPLES / "pearl.toml"))
    lens, backend = design(system.problem).lens, load_backend("double", 1)
    return [
        *_bounds(air_side(lens, "rear")),
        *_blur(system.with_lens(lens), backend),
        *_light(system.with_lens(lens), backend),
    ]


def _bounds(graph: BSplineSurface) -> Iterator[Row]:
    """Yield how far the bounds are apart, how far above dense samples, and their time."""
    h = graph.kv_u.stop
    x, y = (a.ravel() for a in np.meshgrid(*[np.linspace(-h, h, DENSE)] * 2))
    at = round_axis(graph, x, y)

    def turned(enclosure: Enclosure) -> tuple[float, float]:
        return 1 / enclosure.upper, 1 / enclosure.lower

    def plain(enclosure: Enclosure) -> tuple[float, float]:
        return enclosure.lower, enclosure.upper

    cases: list[tuple[str, Callable[[], tuple[float, float]], Floats]] = [
        (
            "concave curvature, any direction",
            lambda: turned(ball_fit(graph, BALL).least),
            concavity(graph, x, y, False),
        ),
        (
            "concave curvature, sections through the axis",
            lambda: turned(nose_fit(graph, NOSE).least),
            concavity(graph, x, y, True),
        ),
        ("slope along the cut", lambda: plain(greatest_slope_along_cut(graph)), abs(at.across)),
        (
            "acceleration of a nose of 1 mm",
            lambda: plain(greatest_acceleration(graph, NOSE, ADVANCE)),
            tool_acceleration(at, NOSE, ADVANCE),
        ),
    ]
    for name, bound, samples in cases:
        start = perf_counter()
        lower, upper = bound()
        seconds = perf_counter() - start
        yield Row(
            f"{name}: upper over lower bound - 1",
            upper / lower - 1,
            limit=2e-3,
            quantity=name,
            estimator="certified",
        )
        above = f"{DENSE} x {DENSE} samples"
        yield Row("  upper bound over greatest sample - 1", upper / samples.max() - 1, "", above, 0.0, ">=")
        yield Row("  time", seconds, "s", limit=10.0)


def _blur(system: System, backend: Backend) -> Iterator[Row]:
    """Yield the blur of cusps, and its error against rays refracted at both sides of every cusp."""
    lens = system.designed
    zero = np.zeros(1)
    flat = ball_cusps(air_side(lens, "front"), zero, zero, BALL, STEP, "x")
    yield Row("cusps of a ball of 6 mm, step 0.1 mm, on a plane", 1e3 * float(flat.height[0]), "um", "0.2")
    blur = _blur_of(system, backend, BALL)
    by_hand = system.problem.target.distance * (lens.index - 1) * STEP / BALL / _pixel(system)
    reference = f"L (n - 1) s / R on a plane: {by_hand:.3g}"
    yield Row("  blur on the pearl, rms over the light", STEP * blur.rms, "pixels", reference)
    yield Row("  blur on the pearl, greatest", STEP * blur.worst()[0], "pixels", reference)
    start = perf_counter()
    (found,) = tool_findings(system, ToolOrder(ball=SMALL_BALL), backend).surfaces
    yield Row("a ball of 3 mm: whole answer", perf_counter() - start, "s", limit=10.0)
    yield Row("  largest step for one pixel", found.largest_pitch or 0.0, "mm")
    response = landing_response(system, backend, "rear", RAYS)
    for step in (0.02, STEP):
        cusps = ball_cusps(found.graph, response.x, response.y, SMALL_BALL, step, "x")
        path, rays = system.path, system.source.rays((RAYS, RAYS))
        added = np.zeros((2, len(response.landed)))
        added[:, response.landed] = cusps.slopes / 2
        paths = (path.with_slope_errors((None, sign * added)) for sign in (-1.0, 1.0))
        ends = [traced_points(erring, backend, rays)[0] for erring in paths]
        spread = np.hypot(*(ends[1] - ends[0])[:, response.landed]) / _pixel(system)
        wanted = step * _blur_of(system, backend, SMALL_BALL).pixels
        off = float(np.abs(spread / wanted - 1).max())
        name = f"  blur by the Jacobian against the exact trace, step {step:g} mm, greatest relative error"
        yield Row(name, off, limit=0.02, quantity="width of the blur", estimator="exact trace of both slopes")


def _light(system: System, backend: Backend) -> Iterator[Row]:
    """Yield rel_l2 of the lens with cusps."""
    graph, blur = air_side(system.designed, "rear"), _blur_of(system, backend, SMALL_BALL)
    steps = {"the largest step for one pixel": 1 / blur.worst()[0], "step 0.02 mm": 0.02, "step 0.1 mm": STEP}
    for name, step in steps.items():
        start = perf_counter()

        def slopes(x: Floats, y: Floats, step: float = step) -> Floats:
            return ball_cusps(graph, x, y, SMALL_BALL, step, "x").slopes

        light = light_with_cusps(system, backend, "rear", slopes, step * blur.worst()[0])
        assert light is not None  # the pearl's source has no extent
        yield Row(
            f"rel_l2 of the pearl cut by a ball of 3 mm, {name}",
            light.with_cusps,
            reference=f"without cusps {light.without:.4f}",
            quantity="irradiance, box pixels, unit mean",
            estimator="cells, mean over the phases of a pass",
        )
        yield Row("  time", perf_counter() - start, "s", limit=20.0)


def _blur_of(system: System, backend: Backend, ball: float) -> CuspBlur:
    response = landing_response(system, backend, "rear", RAYS)
    return cusp_blur(
        air_side(system.designed, "rear"), response, system.target.screen(), ToolOrder(ball=ball)
    )


def _pixel(system: System) -> float:
    """Return the pitch of square pixels, mm."""
    target = system.problem.target
    return 2 * target.half_width[0] / target.pixels[0]
