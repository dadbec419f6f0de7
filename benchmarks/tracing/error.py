"""Run time against relative L2 error in a Gaussian window, of the irradiance and of the gradient: Mitsuba's
methods and ours, on three lenses.

Everything is measured with a Gaussian window of sigma 1 pixel, on one thread; its figure shows the
curves. The base and pearl lenses have parallel rays; the extended source needs points in four dimensions.
Box pixels are measured by `thbcad bench pixels`.

Run: thbcad bench error
"""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from benchmarks.page_picture import keep
from benchmarks.rows.row import Row
from benchmarks.tracing.error_cases import STORE, Case, Reference, cases, reference
from benchmarks.tracing.error_figure import draw
from benchmarks.tracing.error_limits import limit_rows
from benchmarks.tracing.error_methods import (
    GAUSSIAN,
    camera_noise,
    camera_points,
    exact_points,
    mesh_points,
    quantity,
)
from optics.base.runtime import load_backend
from oracles.error_measures import Point, observed_order, seconds_at

WANTED = 1e-3  # relative L2 error of the irradiance at which run times are compared
CLEAR = 3.0  # times the reference's own error: points below it say nothing of the order
LIMITS = {"pearl": 1e4}  # least ratio of times in the same window, below half of that measured
IMAGE, GRADIENT = quantity(GAUSSIAN), "gradient of the fit, Gaussian window"
FIGURE = STORE / "error.png"


def rows() -> list[Row]:
    """Return the measured rows, and draw the curves."""
    mitsuba = find_spec("mitsuba") is not None
    if mitsuba:
        from optics.exchange.mitsuba import load_mitsuba

        load_mitsuba(threads=1)
    backend = load_backend("double", 1)
    out, points, truths = [], [], {}
    for case in cases(backend):
        truth = truths[case.name] = reference(case, backend)
        own = [
            *exact_points(case, truth),
            *(mesh_points(case, truth) + camera_points(case, truth) if mitsuba else []),
        ]
        points += own
        out += [*_reference_rows(case, truth), *_point_rows(own, truth), *_method_rows(own, truth)]
        out += _ratio_rows(case, own) if mitsuba else []
    draw(points, truths, FIGURE)
    return [*out, *limit_rows(backend, mitsuba)]


def publish() -> None:
    """Keep the curves as docs/pictures/error.webp."""
    keep(FIGURE, "error")


def methods(points: list[Point]) -> dict[str, list[Point]]:
    """Return the points by method, fewest rays first."""
    names = dict.fromkeys(p.method for p in points)
    return {name: sorted((p for p in points if p.method == name), key=lambda p: p.rays) for name in names}


def _reference_rows(case: Case, truth: Reference) -> list[Row]:
    c, r = case.screen.pixels
    how = "ours, two sets of rays"
    return [
        Row(
            f"{case.name}: reference's own error, irradiance",
            truth.image_error,
            "",
            f"{c} x {r} pixels, Gaussian window of 1 px",
            quantity=IMAGE,
            estimator=how,
        ),
        Row(
            f"{case.name}: reference's own error, gradient",
            truth.gradient_error,
            "",
            f"{len(truth.gradient)} coefficients",
            quantity=GRADIENT,
            estimator=how,
        ),
    ]


def _point_rows(points: list[Point], truth: Reference) -> list[Row]:
    out = []
    for p in points:
        note = f"{p.seconds:.3g} s"
        if np.isfinite(p.gradient_error):
            note += f"; gradient: error {p.gradient_error:.2e} in {p.gradient_seconds:.3g} s"
        name = f"{p.case}: {p.method}, {p.rays} rays: error"
        of = {"quantity": IMAGE, "estimator": p.method, "error": truth.image_error}
        out.append(Row(name, p.error, "", note, **of))
    return out


def _method_rows(points: list[Point], truth: Reference) -> list[Row]:
    """Return cost per ray, orders and memory of every method, of its run with most rays."""
    out = []
    for name, own in methods(points).items():
        rays, last = [p.rays for p in own], own[-1]
        title, most = f"{last.case}: {name}", [p for p in own if np.isfinite(p.gradient_seconds)][-1]
        order = observed_order(rays, [p.error for p in own], CLEAR * truth.image_error)
        slope = observed_order(rays, [p.gradient_error for p in own], CLEAR * truth.gradient_error)
        image = {"quantity": IMAGE, "estimator": name, "error": last.error}
        gradient = {"quantity": GRADIENT, "estimator": name, "error": most.gradient_error}
        cost = 1e9 * most.gradient_seconds / most.rays
        out += [
            Row(f"{title}: cost per ray, irradiance", 1e9 * last.seconds / last.rays, "ns", **image),
            Row(f"{title}: cost per ray, loss + gradient", cost, "ns", **gradient),
            Row(f"{title}: order of the irradiance in rays", order, quantity=IMAGE, estimator=name),
        ]
        if np.isfinite(slope):
            title_of = f"{title}: order of the gradient in rays"
            out.append(Row(title_of, slope, quantity=GRADIENT, estimator=name))
        out.append(
            Row(f"{title}: memory of loss + gradient", most.megabytes, "MB", f"{most.rays} rays", **gradient)
        )
    return out


def _ratio_rows(case: Case, points: list[Point]) -> list[Row]:
    """Return how many times quicker ours reaches an error than the particle tracer in the same window.

    The error is the wanted one, or the least of ours where that is greater.
    """
    ours = {name: own for name, own in methods(points).items() if name.startswith("ours")}
    wanted = max(WANTED, min(p.error for own in ours.values() for p in own))
    reached = {name: seconds_at(own, wanted) for name, own in ours.items()}
    best = min(reached, key=reached.get)
    title, limit = f"{case.name}: {GAUSSIAN}, ptracer to ours", LIMITS.get(case.name)
    return [camera_noise(case, GAUSSIAN).ratio(title, reached[best], wanted, GAUSSIAN, limit)]
