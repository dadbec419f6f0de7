"""Study 10: light from several sources, by deconvolution and by non-negative approximation (chapter 7)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.thesis.chapter7 import several_sources_page
from benchmarks.thesis.drawing import png
from benchmarks.thesis.pages import Section
from benchmarks.thesis.records import Arrays, Found, Results, Run
from examples.thesis.chapter7.analytic import RectangleResponse
from examples.thesis.chapter7.comparison import CASES, Response, compare
from examples.thesis.chapter7.deconvolution import Case, figure_7_4
from examples.thesis.chapter7.pictures import (
    SOURCES,
    SPLITS,
    TARGETS,
    deconvolution,
    methods,
    positions,
    rectangles,
)
from examples.thesis.chapter7.two_source_landscape import MARKS, STEPS, landscape, two_sources
from optics.designing.etendue import Approximation

NUMBER = several_sources_page.NUMBER
TITLE = several_sources_page.TITLE
MOST = {True: 13, False: STEPS}  # the greatest m and n of a landscape; 13 is the greatest of a mark
PIXELS = 8  # of a piece of Figure 7.5, for its convolution

Floats = NDArray[np.float64]


def runs(quick: bool) -> list[Run]:
    """Return the runs; the quick set has smaller landscapes."""
    return [
        Run("figure 7.4", lambda _: deconvolved()),
        Run("figure 7.5", lambda _: split()),
        *(Run(f"landscape of the {name}", partial(_landscape, name, MOST[quick])) for name in TARGETS),
        *(Run(f"figure {case.figure}", partial(_compared, k)) for k, case in enumerate(CASES)),
    ]


def section(results: Results) -> Section:
    """Return what the page says."""
    return several_sources_page.section(results)


def pictures(results: Results) -> Iterator[tuple[str, bytes]]:
    """Yield Figures 7.4, 7.5 and 7.7 to 7.12."""
    yield "study10_deconvolution", png(deconvolution(_cases(results["figure 7.4"].arrays)))
    yield "study10_rectangles", png(rectangles())
    for name, make in TARGETS.items():
        arrays = results[f"landscape of the {name}"].arrays
        marks = {(m, n): _response(arrays, f"{m} {n}") for m, n in MARKS[name]}
        yield f"study10_{name}", png(positions(make(), arrays["residual"], marks))
    for case in CASES:
        found = results[f"figure {case.figure}"]
        responses = {name: _response(found.arrays, name) for name in found.numbers["methods"]}
        yield f"study10_figure_{case.figure.replace('.', '_')}", png(methods(responses))


def deconvolved() -> Found:
    """Return the three cases of Figure 7.4."""
    cases = figure_7_4()
    numbers = {
        "samples": len(cases[0].x),
        "half_width": [case.half_width for case in cases],
        "sources": [list(case.sources) for case in cases],
        "negative": [case.negative for case in cases],
        "outside": [case.outside for case in cases],
        "greatest": [float(np.abs(case.response).max()) for case in cases],
        "changes": [_changes(case.response) for case in cases],
    }
    arrays = {"x": cases[0].x}
    for k, case in enumerate(cases):
        arrays |= {f"target{k}": case.target, f"response{k}": case.response}
        arrays[f"sources{k}"] = np.array([case.half_width, *case.sources])
    return Found(numbers, arrays)


def _changes(response: Floats) -> int:
    """Return how often the sign changes, rounding left out: values above a tenth of the greatest count."""
    clear = response[np.abs(response) > 0.1 * np.abs(response).max()]
    return int(np.count_nonzero(np.diff(np.signbit(clear))))


def split() -> Found:
    """Return which pieces of the rectangle a source lights in Figure 7.5, and the error of their sum."""
    numbers: dict[str, list[object]] = {"splits": list(SPLITS), "pieces": [], "lit": [], "error": []}
    for m in SPLITS:
        kernel, light = RectangleResponse(1.0, SOURCES, m).on_pixels(PIXELS)
        made = np.trim_zeros(np.convolve(light[0], kernel.weights[0]))
        lit = np.flatnonzero(light[0, ::PIXELS]) + 1
        numbers["pieces"].append(len(made) // PIXELS)
        numbers["lit"].append(lit.tolist())
        numbers["error"].append(float(np.abs(made - 1).max()))
    return Found(numbers)


def _landscape(name: str, most: int, _: Results) -> Found:
    """Return the landscape of a target, and image and response at the marked positions."""
    target = TARGETS[name]()
    found = landscape(target, most)
    numbers = {
        "residual": found.residual.tolist(),
        "kkt": float(found.kkt.max()),
        "gap": float((found.residual - found.lower_bound).max()),
        "marks": [list(mark) for mark in MARKS[name]],
    }
    arrays = {"residual": found.residual}
    for m, n in MARKS[name]:
        arrays |= _arrays(two_sources(target, m, n), f"{m} {n}")
    return Found(numbers, arrays)


def _compared(k: int, _: Results) -> Found:
    """Return the responses of all methods for a case of Figures 7.9 to 7.12."""
    case = CASES[k]
    best, responses = compare(case)
    first = responses["non-negative"]
    rows, arrays = [], {}
    for name, one in responses.items():
        arrays |= _arrays(one, name)
        size = np.abs(one.light)
        rows.append(
            {
                "residual": one.residual,
                "least": one.least,
                "negative": float(size[one.light < 0].sum() / size.sum()),
                "roughness": float(np.linalg.norm(np.diff(one.light, axis=0)) / np.linalg.norm(one.light)),
                "dark": float(np.abs(one.image[case.target == 0]).sum() / np.abs(one.image).sum()),
                "light_change": float(np.linalg.norm(one.light - first.light) / np.linalg.norm(first.light)),
                "image_change": float(np.linalg.norm(one.image - first.image) / np.linalg.norm(case.target)),
            }
        )
    numbers = {key: [row[key] for row in rows] for key in rows[0]}
    return Found({"methods": list(responses), "bound": best.lower_bound, **numbers}, arrays)


def _arrays(found: Approximation | Response, name: str) -> dict[str, Floats]:
    """Return what `_response` reads."""
    scale = np.array([found.residual, found.light.min() / np.abs(found.light).max()])
    images = {"light": found.light.astype(np.float32), "image": found.image.astype(np.float32)}
    return {f"{name} {key}": values for key, values in {**images, "scale": scale}.items()}


def _response(arrays: Arrays, name: str) -> Response:
    residual, least = arrays[f"{name} scale"]
    return Response(arrays[f"{name} light"], arrays[f"{name} image"], float(residual), float(least))


def _cases(arrays: Arrays) -> Iterator[Case]:
    for k in range(3):
        half_width, *sources = arrays[f"sources{k}"].tolist()
        yield Case(arrays["x"], arrays[f"target{k}"], arrays[f"response{k}"], half_width, tuple(sources))
