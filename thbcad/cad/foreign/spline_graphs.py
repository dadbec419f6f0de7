"""Polynomial splines of one or several faces as one graph z(x, y), with a bound of the distance.

A spline whose x and y are affine in its parameters but for d has the same poles as a graph with
|dz| <= |grad z| d.  Where a surface was split into splines over neighbouring rectangles, the spline on the
union of their knots that takes their values at its Greville points is compared with each of them, pole by
pole on common knots: the differences of poles bound those of the surfaces.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from thbcad.cad.foreign.optical_surface import in_frame
from thbcad.cad.foreign.surveyed_faces import SurveyedFace
from thbcad.cad.foreign.upright_graphs import upright
from thbcad.certified import cell_bounds
from thbcad.checks import EPS, Floats
from thbcad.poses import Pose
from thbcad.splines import BSplineSurface, KnotVector, interpolate, tensor_apply

SAME_KNOT = 1e-9  # of the width: knots that differ by less are one, as the digits of a file leave them
MET = 1e-9  # mm: a spline through several pieces that is farther from them is not their surface


class Graph(NamedTuple):
    """z(x, y) of splines, mm, and how far they are from it at most."""

    surface: BSplineSurface
    deviation: float


def spline_graph(frame: Pose, faces: Sequence[SurveyedFace], vertex: float) -> Graph | None:
    """Return the graph of faces on polynomial splines in a frame, less the height of their vertex.

    None where one of them is no such spline, or where several are not one smooth spline.
    """
    graphs: list[Graph] = []
    for face in faces:
        graph = _graph(frame, face, vertex)
        if graph is None:
            return None
        if not any(_equal(graph.surface, other.surface) for other in graphs):
            graphs.append(graph)
    return graphs[0] if len(graphs) == 1 else _joined(graphs)


def _graph(frame: Pose, face: SurveyedFace, vertex: float) -> Graph | None:
    """Return the graph with the poles of the spline under a face."""
    spline = face.spline
    if not isinstance(spline, BSplineSurface) or min(spline.kv_u.degree, spline.kv_v.degree) < 2:
        return None
    kv_u, kv_v, poles = upright(spline.kv_u, spline.kv_v, in_frame(frame, spline.coefficients))
    (x0, y0), (x1, y1) = poles[0, 0, :2].tolist(), poles[-1, -1, :2].tolist()
    if x1 <= x0 or y1 <= y0:
        return None
    kv_u, kv_v = kv_u.rescale(x0, x1), kv_v.rescale(y0, y1)
    exact = np.stack(np.meshgrid(kv_u.greville(), kv_v.greville(), indexing="ij"), axis=-1)
    apart = np.linalg.norm(poles[..., :2] - exact, axis=-1).max()
    graph = BSplineSurface(kv_u, kv_v, poles[..., 2] - vertex)
    slope = np.hypot(*cell_bounds(graph, ((1, 0), (0, 1))).max(axis=(1, 2)))
    rounding = 64 * EPS * float(np.abs(frame.shift).max() + np.abs(poles).max())
    return Graph(graph, float(slope * (apart + rounding) + rounding))


def _equal(graph: BSplineSurface, other: BSplineSurface) -> bool:
    pairs = [(kv.knots, own.knots) for kv, own in zip(graph.knot_vectors, other.knot_vectors)]
    pairs.append((graph.coefficients, other.coefficients))
    return all(np.array_equal(a, b) for a, b in pairs)


def _joined(graphs: Sequence[Graph]) -> Graph | None:
    """Return one graph for several over parts of a rectangle, as smooth between them as it can be."""
    surfaces = [graph.surface for graph in graphs]
    degrees = [max(s.knot_vectors[axis].degree for s in surfaces) for axis in (0, 1)]
    surfaces = [s.elevate(*degrees) for s in surfaces]
    breaks = [_common_breaks([s.knot_vectors[axis] for s in surfaces]) for axis in (0, 1)]
    pieces = [
        BSplineSurface(_snapped(s.kv_u, breaks[0]), _snapped(s.kv_v, breaks[1]), s.coefficients)
        for s in surfaces
    ]
    for between in range(1, min(degrees)):  # multiplicity of the knots where pieces meet
        kv_u, kv_v = (
            _union([p.knot_vectors[axis] for p in pieces], breaks[axis], between) for axis in (0, 1)
        )
        heights = _heights(pieces, kv_u.greville(), kv_v.greville())
        if not np.isfinite(heights).all():
            return None
        joined = interpolate(kv_u, kv_v, heights)
        apart = max(_distance(joined, piece) for piece in pieces)
        if apart <= MET:
            return Graph(joined, apart + max(graph.deviation for graph in graphs))
    return None


def _common_breaks(knots: Sequence[KnotVector]) -> Floats:
    """Return the breaks of several knot vectors; of those that differ by rounding the first."""
    every = np.sort(np.concatenate([kv.breaks for kv in knots]))
    return every[np.diff(every, prepend=-np.inf) > SAME_KNOT * (every[-1] - every[0])]


def _snapped(kv: KnotVector, breaks: Floats) -> KnotVector:
    """Return a knot vector with its knots at the nearest of some breaks."""
    nearest = np.abs(kv.knots[:, None] - breaks).argmin(axis=1)
    return KnotVector(kv.degree, breaks[nearest])


def _union(knots: Sequence[KnotVector], breaks: Floats, between: int) -> KnotVector:
    """Return the knots that hold several splines side by side; `between` : multiplicity where they meet."""
    degree, counts = knots[0].degree, np.full(len(breaks), between)
    for kv in knots:
        for k, value in enumerate(breaks.tolist()):
            if kv.start < value < kv.stop:
                counts[k] = max(counts[k], int((kv.knots == value).sum()))
    counts[[0, -1]] = degree + 1
    return KnotVector(degree, np.repeat(breaks, counts))


def _heights(pieces: Sequence[BSplineSurface], x: Floats, y: Floats) -> Floats:
    """Return z of the piece over each point of a grid, NaN where there is none."""
    z = np.full((len(x), len(y)), np.nan)
    for piece in pieces:
        (x0, x1), (y0, y1) = piece.kv_u.domain, piece.kv_v.domain
        rows, columns = np.flatnonzero((x >= x0) & (x <= x1)), np.flatnonzero((y >= y0) & (y <= y1))
        if len(rows) and len(columns):
            z[np.ix_(rows, columns)] = piece.grid(x[rows], y[columns])
    return z


def _distance(joined: BSplineSurface, piece: BSplineSurface) -> float:
    """Return a bound of the distance of a spline from one over a part of its rectangle."""
    part = joined.segment(piece.kv_u.domain, piece.kv_v.domain)
    finer_u, finer_v = _finer(part.kv_u, piece.kv_u), _finer(part.kv_v, piece.kv_v)
    nets = [
        tensor_apply(s.kv_u.prolongation(finer_u), s.kv_v.prolongation(finer_v), s.coefficients)
        for s in (part, piece)
    ]
    return float(np.abs(nets[0] - nets[1]).max())


def _finer(kv: KnotVector, other: KnotVector) -> KnotVector:
    """Return the knots of both."""
    breaks = np.union1d(kv.breaks, other.breaks)
    counts = [max(int((k.knots == value).sum()) for k in (kv, other)) for value in breaks.tolist()]
    return KnotVector(kv.degree, np.repeat(breaks, counts))
