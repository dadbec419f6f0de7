"""What the page of study 10 says."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from benchmarks.thesis.pages import Choice, Claim, Picture, Section, Table
from benchmarks.thesis.records import Results
from examples.thesis.chapter7.comparison import CASES
from examples.thesis.chapter7.two_source_landscape import MARKS

NUMBER = 10
TITLE = "Light from several sources"
EXACT = 1e-6  # of a residual: the solver's rounding is far below
CLOSE = 0.01  # of the target's norm, between two images: not to be seen in a picture of 8 bits
NEAR = 4  # pixels between the sources: a sixteenth of the square's side


Floats = NDArray[np.float64]


def section(results: Results) -> Section:
    """Return what the page says."""
    samples = results["figure 7.4"].numbers["samples"]
    most = len(results["landscape of the square"].numbers["residual"]) - 1
    return Section(
        NUMBER,
        TITLE,
        [
            "A point of the source makes the response of the system, and other points make it shifted. The "
            "light of several points is their sum. Which response makes a wanted light?",
            "Figure 7.4 asks a regularised deconvolution. Figure 7.5 splits a rectangle exactly. In Figures "
            "7.7 and 7.8 the second of two equal sources stands m columns and n rows away, m, n = 0 ... "
            f"{most}, and the best non-negative response is found with a lower bound of the residual. "
            "Figures 7.9 to 7.12 set three regularised methods beside it.",
        ],
        [
            *_deconvolution_claims(results),
            *_split_claims(results),
            *_square_claims(results),
            *_distance_claims(results),
            *_method_claims(results),
        ],
        [_certificates(results), _methods(results)],
        _pictures(),
        [
            Choice("samples of Figure 7.4: 10 000 001", f"{samples}, and a period one step longer"),
            Choice("scale of the image for mu of the maximum entropy", "a peak of 255, as of 8-bit images"),
        ],
    )


def _pictures() -> list[Picture]:
    return [
        Picture(
            "study10_deconvolution", "Targets, sources (red), and responses by deconvolution (Figure 7.4)."
        ),
        Picture("study10_rectangles", "A rectangle split between two sources (Figure 7.5)."),
        Picture("study10_square", "Loss landscape and marked positions for the square (Figure 7.7)."),
        Picture("study10_disk", "Loss landscape and marked positions for the disk (Figure 7.8)."),
        *(
            Picture(
                f"study10_figure_{case.figure.replace('.', '_')}",
                f"The {case.shape}, second source at ({case.m}, {case.n}): image and response of four "
                f"methods (Figure {case.figure}).",
            )
            for case in CASES
        ),
    ]


def _deconvolution_claims(results: Results) -> list[Claim]:
    n = results["figure 7.4"].numbers
    negative, outside, changes = n["negative"], n["outside"], n["changes"]
    return [
        Claim(
            "Two sources at +-0.25 make the rectangle of half-width 0.5 with a bounded, non-negative "
            "response.",
            "7.2, Figure 7.4 b0",
            f"{negative[0]:.1e} of the response is negative and {outside[0]:.1e} of it lies where the "
            f"target is dark. It holds if both are below {CLOSE:g}.",
            max(negative[0], outside[0]) < CLOSE,
        ),
        Claim(
            "A rectangle 2% wider gives negative values and no bounded support.",
            "7.2, Figure 7.4 b1",
            f"{negative[1]:.0%} of the response is negative, {outside[1]:.0%} lies where the target is "
            f"dark, and it reaches {n['greatest'][1]:.0f} times the target. It holds if the shares are "
            f"above {CLOSE:g}.",
            min(negative[1], outside[1]) > CLOSE,
        ),
        Claim(
            "A source displaced by 1e-4 gives rapid oscillation, no finite support, and negative values.",
            "7.2, Figure 7.4 b2",
            f"{negative[2]:.0%} of the response is negative, {outside[2]:.0%} lies where the target is "
            f"dark, and its sign changes {changes[2]} times, against {changes[1]} times in the case before. "
            f"It holds if the shares are above {CLOSE:g} and the sign changes more often.",
            min(negative[2], outside[2]) > CLOSE and changes[2] > changes[1],
        ),
    ]


def _split_claims(results: Results) -> list[Claim]:
    n = results["figure 7.5"].numbers
    sources = n["pieces"][0]  # at M = 0 every source lights one piece
    every = [lit == list(range(1, pieces, sources)) for lit, pieces in zip(n["lit"], n["pieces"])]
    printed = [m * sources for m in n["splits"] if m]
    found = [pieces for m, pieces in zip(n["splits"], n["pieces"]) if m]
    lit = "; ".join(", ".join(map(str, pieces)) for pieces in n["lit"])
    return [
        Claim(
            "Split M times, the response is the first and every (N_s + 1)th rectangle; N_s of them make the "
            "light.",
            "7.2.1, (7.19), (7.21), (7.23), Figure 7.5",
            f"For M = {_listed(n['splits'], 'g')} one source lights the pieces {lit}. The sum of all sources "
            f"misses the rectangle by {max(n['error']):.0e}. It holds, read as every N_s-th from the first "
            "on, if these are the pieces and the sum is exact to rounding.",
            all(every) and max(n["error"]) < EXACT,
        ),
        Claim(
            "The rectangle is divided into M N_s rectangles.",
            "7.2.1, below (7.23)",
            f"There are {_listed(found, 'd')} pieces for M = {_listed([m for m in n['splits'] if m], 'd')}: "
            f"2^M N_s. It holds if there are {_listed(printed, 'd')}.",
            found == printed,
        ),
    ]


def _landscape(results: Results, name: str) -> Floats:
    """Return the residuals of a landscape, at [n, m]."""
    return np.array(results[f"landscape of the {name}"].numbers["residual"])


def _square_claims(results: Results) -> list[Claim]:
    square = _landscape(results, "square")
    zeros = np.argwhere(square < EXACT)
    away = sorted({int(max(position)) for position in zeros})
    off, feet = square[1:, 1:], np.maximum(square[:1, 1:], square[1:, :1])
    return [
        Claim(
            "For the square, good positions lie along the axes, and are those of the split rectangle.",
            "7.4, Figure 7.7 b0",
            f"{len(zeros)} positions have a residual below {EXACT:g}. They are {_listed(away, 'd')} pixels "
            "away, where the square has 64. It holds if all lie on an axis, at powers of two.",
            all(min(p) == 0 for p in zeros.tolist()) and all(d & (d - 1) == 0 for d in away),
        ),
        Claim(
            "Moving the source away from the axis degrades the light.",
            "7.4, Figure 7.7",
            f"Of {off.size} positions off the axes {int(np.sum(off > feet))} are worse than both positions "
            "on the axes with the same m or the same n. It holds if all are.",
            bool((off > feet).all()),
        ),
    ]


def _distance_claims(results: Results) -> list[Claim]:
    square, disk = (_landscape(results, name) for name in ("square", "disk"))
    marks = [disk[n, m] for m, n in MARKS["disk"]]
    away = np.hypot(*np.indices(disk.shape))
    rank = spearmanr(away.ravel(), disk.ravel()).statistic
    worst = [loss[away <= NEAR].max() for loss in (square, disk)]
    median = [np.median(loss[away > NEAR]) for loss in (square, disk)]
    return [
        Claim(
            "For the disk, the quality degrades with the distance of the sources.",
            "7.4, Figure 7.8",
            f"The residuals at the three marks are {_listed(marks, '.3f')}. Distance and residual have a "
            f"rank correlation of {rank:.2f} over all positions. It holds if the marks ascend and the "
            "correlation exceeds 0.9.",
            bool(np.all(np.diff(marks) > 0) and rank > 0.9),
        ),
        Claim(
            "If the shift is small against the target, a good approximation can be found.",
            "7.4, 7.5",
            f"Within {NEAR} pixels the worst residual is {_listed(worst, '.3f')} (square, disk). Beyond, "
            f"half of all positions are above {_listed(median, '.3f')}. It holds if the first are below the "
            "second.",
            all(near < beyond for near, beyond in zip(worst, median)),
        ),
    ]


def _method_claims(results: Results) -> list[Claim]:
    n = {case.figure: results[f"figure {case.figure}"].numbers for case in CASES}
    _, entropy, cg, laplacian = range(4)
    first, *others = n.values()
    entropy_least = min(one["least"][entropy] for one in n.values())
    changes = [one["image_change"][entropy] for one in n.values()]
    negative = [[one["negative"][method] for one in others] for method in (cg, laplacian)]
    rough = [[one["roughness"][method] for one in others] for method in (cg, laplacian)]
    dark = [[one["dark"][method] for one in n.values()] for method in (0, laplacian)]
    return [
        Claim(
            "Maximum entropy is non-negative and closely resembles the non-negative approximation.",
            "7.4.1, Figures 7.9 to 7.12",
            f"Its least value is {entropy_least:.1g}. The images differ by {_listed(changes, '.2%')} of the "
            f"target's norm. It holds if no value is negative and no difference exceeds {CLOSE:.0%}.",
            entropy_least >= 0 and max(changes) < CLOSE,
        ),
        Claim(
            "Conjugate gradients reach the non-negative solution in Figure 7.9 only, and oscillate "
            "elsewhere.",
            "7.4.1",
            f"In Figure 7.9 the responses differ by {first['light_change'][cg]:.0e}. In the others "
            f"{_listed(negative[0], '.0%')} of the response is negative. It holds if the first is rounding "
            f"and the others exceed {CLOSE:.0%}.",
            first["light_change"][cg] < EXACT and min(negative[0]) > CLOSE,
        ),
        Claim(
            "With the Laplacian the response is much smoother and much less negative.",
            "7.4.1, Figures 7.10 to 7.12",
            f"The differences of neighbours, relative to the response, are {_listed(rough[1], '.2f')} "
            f"against {_listed(rough[0], '.2f')}. {_listed(negative[1], '.0%')} of the response is "
            "negative. It holds if both are smaller in all three figures.",
            all(np.less(rough[1], rough[0])) and all(np.less(negative[1], negative[0])),
        ),
        Claim(
            "With the Laplacian the light extends beyond the target.",
            "7.4.1",
            f"{_listed(dark[1], '.0%')} of the light lies beside the target, against "
            f"{_listed(dark[0], '.1%')} of the non-negative approximation. It holds if the first are "
            "greater.",
            all(np.greater(dark[1], dark[0])),
        ),
    ]


def _certificates(results: Results) -> Table:
    rows = []
    for target in ("square", "disk"):
        n = results[f"landscape of the {target}"].numbers
        residual = np.array(n["residual"])
        marks = ", ".join(f"({m}, {k}): {residual[k, m]:.4f}" for m, k in n["marks"])
        rows.append((target, str(residual.size), marks, f"{n['kkt']:.0e}", f"{n['gap']:.0e}"))
    head = (
        "target",
        "positions",
        "residual at the marks",
        "greatest KKT residual",
        "greatest gap to the bound",
    )
    return Table("Landscapes: best residuals, with certificates.", head, rows)


def _methods(results: Results) -> Table:
    rows = []
    for case in CASES:
        n = results[f"figure {case.figure}"].numbers
        for k, method in enumerate(n["methods"]):
            shares = (f"{n[key][k]:.1%}" for key in ("negative", "dark"))
            rows.append((case.figure, method, f"{n['residual'][k]:.4f}", f"{n['least'][k]:.2g}", *shares))
    head = ("figure", "method", "residual", "least / greatest", "negative", "light beside the target")
    return Table("Figures 7.9 to 7.12 in numbers.", head, rows)


def _listed(values: Iterable[float], form: str) -> str:
    return ", ".join(f"{value:{form}}" for value in values)
