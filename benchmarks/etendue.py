"""The limits of extended sources: both bounds, run time, certified gap and errors beside limits, on one core.

Run on one core: OPENBLAS_NUM_THREADS=1 thbcad bench etendue
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from benchmarks.rows.row import Row
from examples.thesis.chapter7.analytic import RectangleResponse
from examples.thesis.chapter7.comparison import CASES, compare
from examples.thesis.chapter7.two_source_landscape import disk, landscape, square
from optics.designing.etendue import (
    FIXED,
    SEARCH,
    Approximation,
    Kernel,
    approximate,
    one_blur,
    radiance,
    rounded_down,
    universal_bound,
    usual_efficiency,
)
from optics.scene.system import load_system
from oracles.seen_envelope import sampled_etendue

T = TypeVar("T")

LIMIT_MIB = 500.0
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SCARCE = {  # extended.toml with a source of 8 mm and a target of 40 mm that is near: etendue is scarce
    "source.half_width": [4.0, 4.0],
    "source.distance": 7.0,
    "target.half_width": [20.0, 20.0],
    "target.distance": 50.0,
}
WIDE = {  # extended.toml with pixels half as wide as their distance
    "target.distance": 20.0,
    "target.half_width": [40.0, 40.0],
    "target.pixels": [8, 8],
    "optimizer.merge": 1,
}
MEMORY = """
from pathlib import Path
from benchmarks.etendue import picture
from optics.designing.etendue import Kernel, approximate
approximate(Kernel.disk(20), picture(512))
lines = Path("/proc/self/status").read_text().splitlines()
print(next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024)
"""


def rows() -> list[Row]:
    """Return the measured rows."""
    return [
        *_universal(),
        *_caps(),
        *_one_blur(),
        *_landscapes(),
        *_general(),
        *_large(),
        *_analytic(),
        *_comparison(),
    ]


def picture(pixels: int) -> NDArray[np.float64]:
    """Return a target with edges, gradients and fine stripes, which no source of some pixels can make."""
    x = (np.arange(pixels) + 0.5) / pixels * 2 - 1
    u, v = np.meshgrid(x, x)
    stripes = 0.5 + 0.5 * np.cos(np.pi * (40 * u**2 + 15 * v))
    hill = np.exp(-3 * ((u - 0.3) ** 2 + (v + 0.2) ** 2))
    return np.where(np.hypot(u, v) < 0.8, 0.6 * hill + 0.4 * stripes, 0.05) * (np.abs(u + v) > 0.15)


def _universal() -> list[Row]:
    """Return the bound that holds for every lens in the envelope."""
    found = []
    for name in ("extended", "extended_two"):
        system = load_system(EXAMPLES / f"{name}.toml")
        usual = usual_efficiency(system)
        bound, seconds = _timed(lambda system=system: universal_bound(system))
        (curve, curve_seconds) = _timed(bound.curve)
        found += [
            Row(f"any lens, {name}", seconds + curve_seconds, "s", "256 x 256 pixels, with its curve", 1.0),
            Row("   least rel_l2 with all light of the source", curve[-1][1] or 0.0),
            Row("   least rel_l2 with one pass of two uncoated faces", bound.least_rel_l2(usual) or 0.0),
            Row("   greatest flux on the lit pixels", bound.most_on_lit, "W"),
            Row("   highest irradiance", bound.peak, "W/mm^2"),
        ]
    scarce = universal_bound(load_system(EXAMPLES / "extended.toml", SCARCE))
    curve = [(e, least) for e, least in scarce.curve() if least is not None]
    return [
        *found,
        Row(
            "any lens, source of 8 mm, target of 40 mm at 50 mm: exact picture up to", scarce.exact_efficiency
        ),
        Row("   greatest flux on the target", scarce.most_on_target, "W"),
        Row("   greatest flux on the lit pixels", scarce.most_on_lit, "W"),
        *(Row(f"   least rel_l2 at the efficiency {e:g}", least) for e, least in curve),
    ]


def _caps() -> list[Row]:
    """Return the bound of pixels over what they see of the envelope by dense sampling from within."""
    found = []
    for name, where, changes, limit in (
        ("extended", "", {}, 1.03),
        ("extended_two", "", {}, 1.03),
        ("street", "", {}, 1.03),
        ("extended", ", source of 8 mm, target of 40 mm at 50 mm", SCARCE, 1.03),
        ("extended", ", pixels of 10 mm at 20 mm", WIDE, 1.5),
    ):
        system = load_system(EXAMPLES / f"{name}.toml", changes)
        universal, (columns, rows) = universal_bound(system), system.target.screen().pixels
        pixels = [(i, j) for i in (0, rows // 4, rows // 2) for j in (0, columns // 3, columns // 2)]
        bound = np.array([universal.most[at] for at in pixels])
        over = bound / radiance(system) / sampled_etendue(system, pixels)
        found += [
            Row(f"bound over sampled envelope, {name}{where}", over.max(), "", "greatest", limit),
            Row("   least", over.min(), "", "", 1.0, sense=">="),
        ]
    return found


def _one_blur() -> list[Row]:
    """Return the bound of one blur everywhere, a model, for the rear of the base lens."""
    found = []
    for name in ("extended", "extended_two"):
        system = load_system(EXAMPLES / f"{name}.toml")
        usual = usual_efficiency(system)
        for form, care in (("source's", FIXED), ("any", SEARCH)):
            start = process_time()
            images = one_blur(system.unshaped, usual, care, any_form=form == "any").bound
            found += [
                Row(
                    f"one blur in {form} proportions, {name}",
                    process_time() - start,
                    "s",
                    f"{images.sizes} sizes",
                ),
                Row("   rel_l2 is at least", float(rounded_down(images.lower_bound)), "", "rounded down"),
                Row("   the solver attains", images.attained),
            ]
    return found


def _timed(function: Callable[[], T]) -> tuple[T, float]:
    """Return the result of a second call and its processor time, s."""
    function()
    start = process_time()
    return function(), process_time() - start


def _landscapes() -> list[Row]:
    found = []
    for name, target in (("square", square()), ("disk", disk())):
        start = process_time()
        result = landscape(target)
        found += [
            Row(
                f"landscape of the {name}, 441 positions at 256^2",
                process_time() - start,
                "s",
                "6.1 s, an earlier prototype",
                10,
            ),
            Row("   greatest relative KKT residual", float(result.kkt.max()), "", "", 1e-8),
            Row(
                "   greatest residual less its lower bound",
                float((result.residual - result.lower_bound).max()),
                "",
                "",
                1e-8,
            ),
        ]
    return found


def _general() -> list[Row]:
    kernels = {
        "disk of 6 px": Kernel.disk(6),
        "rectangle of 15 x 9 px": Kernel.rectangle(7.5, 4.5),
        "Gaussian, sigma 3 px": Kernel.image(np.exp(-(np.hypot(*np.mgrid[-9:10, -9:10]) ** 2) / 18)),
        "five points": Kernel.points([(0, 0), (5, 1), (-2, 7), (4, -6), (-6, -3)], [1, 1, 1, 1, 1]),
    }
    cases = [(f"{name}, picture", kernel, picture(256)) for name, kernel in kernels.items()]
    cases += [
        ("disk of 6 px, square", kernels["disk of 6 px"], square()),
        ("disk of 6 px, disk", kernels["disk of 6 px"], disk()),
    ]
    return [row for name, kernel, target in cases for row in _solve(f"256^2, {name}", kernel, target, 1.0)]


def _solve(name: str, kernel: Kernel, target: NDArray[np.float64], limit: float) -> list[Row]:
    result, seconds = _timed(lambda: approximate(kernel, target))
    return [
        Row(name, seconds, "s", f"{result.iterations} iterations", limit),
        Row("   relative KKT residual", result.kkt, "", "", 1e-5),
        Row("   residual |E * F - G| / |G|", result.residual, "", "least possible"),
        Row("   gap to the lower bound, of the residual", _gap(result), "", "", 0.01),
    ]


def _gap(result: Approximation) -> float:
    return 1 - result.lower_bound / result.residual if result.residual > 0 else 0.0


def _large() -> list[Row]:
    output = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, check=True).stdout
    rows = _solve("512^2, disk of 20 px", Kernel.disk(20), picture(512), 10.0)
    return [
        *rows,
        Row(
            "   greatest memory of the process", float(output), "MiB", "Python and scipy included", LIMIT_MIB
        ),
    ]


def _analytic() -> list[Row]:
    found = []
    for sources, splits, pixels in ((2, 0, 8), (2, 1, 4), (2, 3, 3), (3, 2, 3), (5, 1, 4)):
        kernel, light = RectangleResponse(1.0, sources, splits).on_pixels(pixels)
        margin = kernel.weights.shape[1]
        target = np.pad(np.ones((1, pixels * sources * 2**splits)), ((0, 0), (margin, margin)))
        result = approximate(kernel, target, 1e-12)
        first = np.flatnonzero(result.solution[0] > 0.5)[0]
        error = float(np.abs(result.solution[0, first : first + light.shape[1]] - light[0]).max())
        found.append(
            Row(
                f"analytic response, {sources} sources, {splits} splits: error of the solver's",
                error,
                "",
                "",
                1e-8,
            )
        )
    return found


def _comparison() -> list[Row]:
    found = []
    for case in CASES:
        best, responses = compare(case)
        for name, response in responses.items():
            text = f"least light {response.least:.2g} of the greatest"
            found.append(Row(f"Figure {case.figure}, {name}: residual", response.residual, "", text))
        found.append(Row("   certified lower bound for light of no negative part", best.lower_bound))
    return found
