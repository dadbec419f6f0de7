"""The THB kernel: run time beside error and beside other codes, on the annulus hierarchy that five codes
agree on.

Run on one core: thbcad bench kernel
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import median
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from benchmarks.kernel.cases import Annulus, annulus, annulus_case, coefficients, refined, tensor_case
from benchmarks.kernel.peers import NUTILS_DEPTH, PYGISMO_DEPTH, Peer, annulus_peers, tensor_peers
from benchmarks.rows.row import Row, median_seconds
from thbcad import BSplineSurface, KnotVector, Samples, THBSpace, THBSurface, least_squares

REPEATS = 9
CALLS = 1000  # of one point
NOISE = 0.01  # of samples
AGREEMENT = 1e-12  # with other codes, relative to the greatest value
# ms of pyiga in an earlier run on another machine
PYIGA = {"build": 75, "grid": 57, "gradient": 117, "collocation": 3300, "transfer": 276}


def rows() -> list[Row]:
    """Return the measured rows."""
    case = annulus_case()
    own = THBSurface(annulus(case.marks), coefficients(case.functions))
    tensor = own.to_bspline()
    peers = annulus_peers(case, (tensor.kv_u.knots, tensor.kv_v.knots), tensor.coefficients)
    return [
        *_evaluation(case, own, peers),
        *_matrices(case, own, peers),
        *_patches(own),
        *_transfer(case, own, peers),
        *_restriction(),
        *_corner(peers),
        *_diagonal(),
        *_tensor(),
        *_points(),
        *_smoothing(),
    ]


def ready(space: THBSpace) -> THBSpace:
    """Return a space when the first value of a surface over it is known: what later evaluations need is
    there."""
    THBSurface(space, np.ones(space.dim))([0.5 * space.kv_u.stop], [0.5 * space.kv_v.stop])
    return space


def _others(peers: Sequence[Peer], task: str) -> str:
    """Return the times of the other codes as text."""
    now = {peer.name: peer.times[task] for peer in peers if task in peer.times}
    before = {"pyiga": PYIGA[task]} if task in PYIGA else {}
    parts = [(now, "this run"), (before, "earlier")]
    return "; ".join(
        ", ".join(f"{name} {_shown(time)}" for name, time in times.items()) + f" ({when})"
        for times, when in parts
        if times
    )


def _shown(time: float) -> str:
    return f"{time:.2g} ms" if time < 10 else f"{time:.0f} ms" if time < 1000 else f"{time / 1000:.1f} s"


def _ms(function: Callable[[], object], repeats: int = REPEATS) -> float:
    return 1e3 * median_seconds(function, repeats)


def _differences(peers: Sequence[Peer], task: str, values: NDArray[np.float64] | csr_array) -> list[Row]:
    """Return rows with the greatest difference from the other codes, relative to the greatest value."""
    scale = float(abs(values).max())
    return [
        Row(
            f"   difference from {peer.name}",
            float(abs(peer.values[task] - values).max()) / scale,
            "",
            "",
            AGREEMENT,
        )
        for peer in peers
        if task in peer.values
    ]


def _evaluation(case: Annulus, surface: THBSurface, peers: Sequence[Peer]) -> list[Row]:
    space, c, x = surface.space, surface.coefficients, case.grid

    def with_gradient() -> list[NDArray[np.float64]]:
        own = THBSurface(space, c)
        return [own.grid(x, x, derivative) for derivative in ((0, 0), (1, 0), (0, 1))]

    gradient = np.stack(with_gradient()[1:]).reshape(2, -1)
    return [
        Row("annulus: degrees of freedom", space.dim, "", "5593; the other codes are held to it"),
        Row(
            "annulus: 5 refinements up to the first value",
            _ms(lambda: ready(annulus(case.marks))),
            "ms",
            _others(peers, "build"),
            10,
        ),
        Row(
            "annulus: values on 449^2, operators built",
            _ms(lambda: THBSurface(space, c).grid(x, x)),
            "ms",
            _others(peers, "grid"),
            3,
        ),
        *_differences(peers, "grid", surface.grid(x, x).ravel()),
        Row(
            "annulus: values and gradient on 449^2", _ms(with_gradient), "ms", _others(peers, "gradient"), 10
        ),
        *_differences(peers, "gradient", gradient),
        Row(
            "annulus: 201,601 scattered points",
            _ms(lambda: surface(*case.points), 5),
            "ms",
            _others(peers, "scattered"),
            80,
        ),
        *_differences(peers, "scattered", surface(*case.points)),
    ]


def _matrices(case: Annulus, surface: THBSurface, peers: Sequence[Peer]) -> list[Row]:
    space, (u, v) = surface.space, case.points
    time = _ms(lambda: space.collocation(u, v), 3)
    matrix = space.collocation(u, v)
    error = float(abs(matrix @ surface.coefficients - surface(u, v)).max())
    return [
        Row("annulus: collocation matrix of these points", time, "ms", _others(peers, "collocation"), 150),
        *_differences(peers, "collocation", matrix),
        Row("   times the coefficients, against the surface", error, "", "", 1e-13),
        Row("annulus: its derivative in u", _ms(lambda: space.collocation(u, v, (1, 0)), 3), "ms", "", 200),
        Row("annulus: its derivative in v", _ms(lambda: space.collocation(u, v, (0, 1)), 3), "ms", "", 200),
    ]


def _patches(surface: THBSurface) -> list[Row]:
    return [
        Row("annulus: exact patches", len(surface.to_patches()), "", "leaves 1261, minimum 381", 381),
        Row("annulus: time of the patches", _ms(surface.to_patches, 5), "ms", "", 200),
    ]


def _transfer(case: Annulus, surface: THBSurface, peers: Sequence[Peer]) -> list[Row]:
    fine, coarse, c = surface.space, annulus(case.marks[:-1]), coefficients(case.before)
    p = coarse.prolongation(fine)
    x = np.linspace(0, 1, 301)
    error = abs(THBSurface(coarse, c).grid(x, x) - THBSurface(fine, p @ c).grid(x, x)).max()
    return [
        Row(
            "transfer 2797 to 5593, explicit",
            _ms(lambda: coarse.prolongation(fine)),
            "ms",
            _others(peers, "transfer"),
            10,
        ),
        Row(
            "   between spaces that were not used before",
            1e3 * median(_first_transfer(case) for _ in range(5)),
            "ms",
            "",
            10,
        ),
        Row("   error of the geometry", float(error), "", "", 2e-15),
        *_differences(peers, "transfer", p @ c),
        Row("restriction 5593 to 2797", _ms(lambda: fine.restriction(coarse), 3), "ms"),
    ]


def _first_transfer(case: Annulus) -> float:
    """Return the seconds of a prolongation whose spaces know their functions and nothing more."""
    coarse, fine = annulus(case.marks[:-1]), annulus(case.marks)
    assert (coarse.dim, fine.dim) == (2797, 5593)
    start = perf_counter()
    coarse.prolongation(fine)
    return perf_counter() - start


def _restriction() -> list[Row]:
    """8 x 8 cells in the middle of 12 x 12 refined, and 12 x 12 of their children: every degree to 5 loses
    functions."""
    defects = []
    for degree in range(1, 6):
        kv = KnotVector.uniform(degree, 12)
        coarse = THBSpace(kv, kv)
        fine = refined(coarse, [2 + np.argwhere(np.ones((8, 8))), 6 + np.argwhere(np.ones((12, 12)))])
        product = fine.restriction(coarse) @ coarse.prolongation(fine)
        product.setdiag(product.diagonal() - 1)
        defects.append(float(abs(product).max()))
    each = ", ".join(f"{defect:.1e}" for defect in defects)
    return [
        Row(
            "restriction of nested blocks, degree 1 to 5: |Q P - I|", max(defects), "", f"each: {each}", 1e-13
        )
    ]


def _corner(peers: Sequence[Peer]) -> list[Row]:
    def time(depth: int, repeats: int = 5) -> tuple[float, float]:
        space, marks = THBSpace(kv, kv), [np.argwhere(np.ones((4, 4)))] * depth
        return _ms(lambda: ready(refined(space, marks)), repeats), len(refined(space, marks).cells)

    kv = KnotVector.uniform(3, 8)
    (low, few), (high, many) = time(6, 15), time(24, 15)
    others = [_others(peers, f"corner, level {depth}") for depth in (NUTILS_DEPTH, PYGISMO_DEPTH)]
    return [
        Row("corner refinement, 8 x 8, level 12 (697 DOF)", time(12)[0], "ms", others[0], 50),
        Row("corner refinement, 8 x 8, level 20 (1081 DOF)", time(20)[0], "ms", "", 100),
        Row(f"corner refinement, 8 x 8, level {PYGISMO_DEPTH}", time(PYGISMO_DEPTH)[0], "ms", others[1]),
        Row(
            "   time per cell, level 24 to level 6",
            high / many / (low / few),
            "",
            f"{many} and {few} cells",
            1.5,
        ),
    ]


def _diagonal() -> list[Row]:
    """Cells (i, j) with |i - j| <= 3 of every level: a band of 4 x 4 blocks along the diagonal."""
    kv = KnotVector.uniform(3, 8)
    marks = []
    for level in range(8):
        i, shift = (x.ravel() for x in np.meshgrid(np.arange(8 << level), np.arange(-3, 4), indexing="ij"))
        pairs = np.stack([i, i + shift], axis=1)
        marks.append(pairs[(pairs[:, 1] >= 0) & (pairs[:, 1] < 8 << level)])
    cells = len(refined(THBSpace(kv, kv), marks).cells)
    time = _ms(lambda: ready(refined(THBSpace(kv, kv), marks)), 1)
    return [
        Row("diagonal refinement, 8 x 8, level 8: cells", cells),
        Row("   8 refinements up to the first value", time, "ms"),
        Row("   the same per 1000 cells", 1e3 * time / cells, "ms"),
    ]


def _tensor() -> list[Row]:
    knots, net, x, new = tensor_case()
    kv = KnotVector(3, knots)
    surface, peers = BSplineSurface(kv, kv, net), tensor_peers(knots, net, x, new)
    finer = surface.insert(new, new).coefficients
    return [
        Row(
            "227^2 bicubic, 3 components, on 449^2",
            _ms(lambda: surface.grid(x, x)),
            "ms",
            _others(peers, "tensor grid"),
            2.5,
        ),
        *_differences(peers, "tensor grid", surface.grid(x, x).reshape(-1, 3)),
        Row(
            "insert 100 knots in u and in v, 227^2 x 3",
            _ms(lambda: surface.insert(new, new)),
            "ms",
            _others(peers, "insert"),
            10,
        ),
        *_differences(peers, "insert", finer),
    ]


def _points() -> list[Row]:
    """Return the rows of calls at one point."""
    kv = KnotVector.uniform(3, 8)
    bspline = BSplineSurface(kv, kv, np.random.default_rng(0).normal(size=(kv.dim, kv.dim)))
    rows = []
    for spline in (bspline, THBSurface(THBSpace(kv, kv), bspline.coefficients)):
        milliseconds = _ms(lambda spline=spline: [spline(0.3, 0.4) for _ in range(CALLS)])
        rows.append(
            Row(f"one point of a bicubic {type(spline).__name__}", 1e3 * milliseconds / CALLS, "us", "", 20)
        )
    return rows


def _smoothing() -> list[Row]:
    """Return the rows of a smoothing that 50,000 noisy samples choose."""
    rng, kv = np.random.default_rng(0), KnotVector.uniform(3, 128)
    u, v = rng.uniform(size=(2, 50_000))
    wave, space = np.sin(5 * u) * v, THBSpace(kv, kv)
    samples = Samples(u, v, wave + NOISE * rng.normal(size=u.size))
    error = least_squares(space, samples, "auto")(u, v) - wave
    return [
        Row(
            "smoothing chosen for 50,000 samples, 128 x 128 cells",
            _ms(lambda: least_squares(space, samples, "auto"), 3) / 1e3,
            "s",
            "",
            8,
        ),
        Row("   rms of what is left of the noise", float(np.sqrt(np.mean(error**2))) / NOISE, "", "", 0.2),
    ]
