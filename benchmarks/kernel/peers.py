"""How other codes do on the cases of the kernel, measured in the same run where they are installed.

Run: thbcad bench peers

G+Smo (pygismo) and nutils build the same hierarchy and evaluate the same spline at the same points; scipy
evaluates its tensor-product form; splipy inserts the same knots.  The times of all but scipy are of one call,
because some take seconds.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, NdBSpline
from scipy.sparse import csr_array

from benchmarks.kernel.cases import SPANS, Annulus, annulus_case, coefficients, tensor_case
from benchmarks.rows.row import Row

if TYPE_CHECKING:
    from nutils.function import Array, Basis
    from nutils.sample import Sample
    from nutils.topology import Topology
    from pygismo.hsplines import gsTHBSpline2, gsTHBSplineBasis2

# read when these packages are loaded
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("NUTILS_NPROCS", "1")

PYGISMO_DEPTH, NUTILS_DEPTH = 8, 12
T = TypeVar("T")
Knots = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Peer:
    """What another code took (ms) and found, by the name of the task."""

    name: str
    times: dict[str, float] = field(default_factory=dict)
    values: dict[str, NDArray[np.float64] | csr_array] = field(default_factory=dict)

    def timed(self, task: str, function: Callable[[], T], repeats: int = 1) -> T:
        """Return what the function returns, and keep its median wall time."""
        times = []
        for _ in range(repeats):
            start = perf_counter()
            result = function()
            times.append(1e3 * (perf_counter() - start))
        self.times[task] = median(times)
        return result

    def require(self, found: int, wanted: int) -> None:
        """Raise RuntimeError unless the code counts the same degrees of freedom: some refine nothing and say
        nothing."""
        if found != wanted:
            raise RuntimeError(f"{self.name} has {found} degrees of freedom where {wanted} were wanted")


def rows() -> list[Row]:
    """Return the times of the peers that are installed."""
    case = annulus_case()
    peers = [*_installed(lambda: pygismo(case), lambda: nutils(case)), *tensor_peers(*tensor_case())]
    return [Row(f"{peer.name}: {task}", time, "ms") for peer in peers for task, time in peer.times.items()]


def annulus_peers(case: Annulus, knots: Knots, net: NDArray[np.float64]) -> list[Peer]:
    """Return scipy, on the tensor-product form given, and pygismo and nutils as far as they are installed."""
    return [scipy(case, knots, net), *_installed(lambda: pygismo(case), lambda: nutils(case))]


def tensor_peers(
    knots: NDArray[np.float64], net: NDArray[np.float64], grid: NDArray[np.float64], new: NDArray[np.float64]
) -> list[Peer]:
    """Return scipy, and splipy if it is installed, on a bicubic surface with the same knots in u and in v."""
    peer = Peer("scipy")
    peer.values["tensor grid"] = peer.timed("tensor grid", lambda: _scipy_grid((knots, knots), net, grid), 9)
    return [peer, *_installed(lambda: splipy(knots, net, grid, new))]


def _installed(*builders: Callable[[], Peer]) -> list[Peer]:
    peers = []
    for build in builders:
        try:
            peers.append(build())
        except ModuleNotFoundError:
            continue
    return peers


def _scipy_grid(
    knots: Knots, net: NDArray[np.float64], grid: NDArray[np.float64], a: int = 0, b: int = 0
) -> NDArray[np.float64]:
    """Return the derivative (a, b) of a bicubic surface on the grid x grid, one row per point: BSpline in u,
    then in v."""
    by_u = BSpline(knots[0], net, 3)(grid, nu=a).swapaxes(0, 1)
    by_v = BSpline(knots[1], by_u, 3)(grid, nu=b).swapaxes(0, 1)
    return by_v.reshape(-1, *net.shape[2:])


def scipy(case: Annulus, knots: Knots, net: NDArray[np.float64]) -> Peer:
    """Return scipy's times and values on the tensor-product form of the spline, medians of several calls."""
    peer, spline = Peer("scipy"), NdBSpline(knots, net, 3)
    peer.values["grid"] = peer.timed("grid", lambda: _scipy_grid(knots, net, case.grid), 9)
    orders = ((0, 0), (1, 0), (0, 1))
    all_three = peer.timed(
        "gradient", lambda: [_scipy_grid(knots, net, case.grid, *order) for order in orders], 9
    )
    peer.values["gradient"] = np.stack(all_three[1:])
    peer.values["scattered"] = peer.timed("scattered", lambda: spline(case.points.T), 5)
    return peer


def pygismo(case: Annulus) -> Peer:
    """Return G+Smo's times and values."""
    from pygismo.hsplines import gsTHBSpline2

    peer, order = Peer("pygismo"), _u_fastest(case.functions)

    def start(marks: Sequence[NDArray[np.int64]], functions: NDArray[np.int64]) -> gsTHBSpline2:
        out = gsTHBSpline2(_gismo_basis(SPANS, marks), coefficients(functions)[_u_fastest(functions), None])
        out.eval(np.array([[0.5], [0.5]]))
        return out

    spline = peer.timed("build", lambda: start(case.marks, case.functions))
    basis = spline.basis()
    peer.require(basis.size(), len(case.functions))
    peer.values["grid"] = peer.timed("grid", lambda: spline.eval(case.grid_points)).ravel()
    peer.values["gradient"] = peer.timed(
        "gradient", lambda: (spline.eval(case.grid_points), spline.deriv(case.grid_points))
    )[1]
    peer.values["scattered"] = peer.timed("scattered", lambda: spline.eval(case.points)).ravel()
    matrix = peer.timed("collocation", lambda: basis.collocationMatrix(case.points))
    peer.values["collocation"] = csr_array(matrix)[:, np.argsort(order)]
    coarse, boxes = start(case.marks[:-1], case.before), _boxes(len(case.marks) - 1, case.marks[-1])
    peer.timed("transfer", lambda: coarse.refineElements(boxes))
    peer.values["transfer"] = coarse.coefs().ravel()[np.argsort(order)]
    block = [np.argwhere(np.ones((4, 4)))] * PYGISMO_DEPTH
    deep = peer.timed(f"corner, level {PYGISMO_DEPTH}", lambda: _gismo_basis(8, block))
    peer.require(deep.size(), 121 + 48 * PYGISMO_DEPTH)
    return peer


def _gismo_basis(spans: int, marks: Sequence[NDArray[np.int64]]) -> gsTHBSplineBasis2:
    """Return the cubic basis over spans x spans cells of [0, 1]^2, refined level by level."""
    from pygismo.hsplines import gsTHBSplineBasis2
    from pygismo.nurbs import gsKnotVector, gsTensorBSplineBasis2

    knots = gsKnotVector(np.r_[[0.0] * 4, np.arange(1, spans) / spans, [1.0] * 4], 3)
    basis = gsTHBSplineBasis2(gsTensorBSplineBasis2(knots, knots))
    for level, cells in enumerate(marks):
        basis.refineElements(_boxes(level, cells))
    return basis


def _boxes(level: int, cells: NDArray[np.int64]) -> list[int]:
    """Return G+Smo's boxes level + 1, i0, j0, i1, j1 in one row: the children, counted in cells of their own
    level."""
    return np.column_stack([np.full(len(cells), level + 1), 2 * cells, 2 * cells + 2]).ravel().tolist()


def _u_fastest(functions: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the functions in G+Smo's order: by level, then v, then u."""
    return np.lexsort((functions[:, 1], functions[:, 2], functions[:, 0]))


def nutils(case: Annulus) -> Peer:
    """Return nutils's times and values, points already located; its evaluations include the
    compilation of the expression."""
    import treelog
    from nutils import function, mesh

    peer, arguments = Peer("nutils"), {"c": coefficients(case.functions)}

    def start(spans: int, marks: Sequence[NDArray[np.int64]]) -> tuple[Topology, Array, Basis]:
        topology, geometry = mesh.rectilinear([np.arange(spans + 1) / spans] * 2)
        topology = _nutils_refined(topology, spans, marks)
        return topology, geometry, topology.basis("th-spline", degree=3)

    def ready() -> tuple[Topology, Array, Basis]:
        topology, geometry, basis = start(SPANS, case.marks)
        _nutils_sample(topology, case.marks, np.array([[0.5], [0.5]])).eval(
            function.dotarg("c", basis), arguments
        )
        return topology, geometry, basis

    with treelog.disable():
        topology, geometry, basis = peer.timed("build", ready)
        peer.require(len(basis), len(case.functions))
        spline = function.dotarg("c", basis)
        both = [spline, function.grad(spline, geometry)]
        grid, points = (_nutils_sample(topology, case.marks, x) for x in (case.grid_points, case.points))
        peer.values["grid"] = peer.timed("grid", lambda: grid.eval(spline, arguments))
        peer.values["gradient"] = peer.timed("gradient", lambda: grid.eval(both, arguments))[1].T
        peer.values["scattered"] = peer.timed("scattered", lambda: points.eval(spline, arguments))
        rows = function.as_csr(points.bind(basis))
        data, indptr, indices = peer.timed("collocation", lambda: function.evaluate(*rows))
        peer.values["collocation"] = csr_array(
            (data, indices, indptr), shape=(case.points.shape[1], len(basis))
        )
        block = [np.argwhere(np.ones((4, 4)))] * NUTILS_DEPTH
        _, _, deep = peer.timed(f"corner, level {NUTILS_DEPTH}", lambda: start(8, block))
        peer.require(len(deep), 121 + 48 * NUTILS_DEPTH)
    return peer


def _nutils_refined(topology: Topology, spans: int, marks: Sequence[NDArray[np.int64]]) -> Topology:
    """Return the topology over spans x spans cells refined level by level; elements count level by level,
    leaves only."""
    leaves = 0
    for _, existing, refined in _levels(spans, marks):
        if len(refined):
            topology = topology.refined_by(leaves + np.searchsorted(existing, refined))
        leaves += len(existing) - len(refined)
    return topology


def _nutils_sample(
    topology: Topology, marks: Sequence[NDArray[np.int64]], points: NDArray[np.float64]
) -> Sample:
    """Return the sample at scattered points of the annulus, without nutils's search for their cells."""
    element, local, count = np.full(points.shape[1], -1), np.zeros(points.shape), 0
    for n, existing, refined in _levels(SPANS, marks):
        leaves = np.setdiff1d(existing, refined)
        cell = np.minimum((points * n).astype(np.int64), n - 1)
        flat = cell[0] * n + cell[1]
        here = np.isin(flat, leaves)
        element[here] = count + np.searchsorted(leaves, flat[here])
        local[:, here] = (points * n - cell)[:, here]
        count += len(leaves)
    return topology._sample(element, local.T)


def _levels(
    spans: int, marks: Sequence[NDArray[np.int64]]
) -> Iterator[tuple[int, NDArray[np.int64], NDArray[np.int64]]]:
    """Yield for every level (n, existing, refined): cells (i, j) as sorted numbers i n + j."""
    existing, n = np.arange(spans**2), spans
    for cells in [*marks, np.zeros((0, 2), dtype=np.int64)]:
        refined = np.sort(cells[:, 0] * n + cells[:, 1])
        yield n, existing, refined
        i, j = np.divmod(refined[:, None], n)
        existing = np.sort(((2 * i + [0, 0, 1, 1]) * 2 * n + 2 * j + [0, 1, 0, 1]).ravel())
        n *= 2


def splipy(
    knots: NDArray[np.float64], net: NDArray[np.float64], grid: NDArray[np.float64], new: NDArray[np.float64]
) -> Peer:
    """Return splipy's times and values on a bicubic surface with the same knots in u and in v."""
    from splipy import BSplineBasis, Surface

    peer, grid = Peer("splipy"), grid.copy()  # splipy moves parameters near knots onto them, in place
    surface = Surface(BSplineBasis(4, knots), BSplineBasis(4, knots), net.copy(), raw=True)
    peer.values["tensor grid"] = peer.timed("tensor grid", lambda: surface(grid, grid)).reshape(
        -1, net.shape[2]
    )

    def insert() -> Surface:
        out = surface.clone()
        out.insert_knot(new.tolist(), 0)
        out.insert_knot(new.tolist(), 1)
        return out

    peer.values["insert"] = peer.timed("insert", insert).controlpoints
    return peer
