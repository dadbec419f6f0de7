"""Graphs z(x, y) as tensor-product splines: conics, poles, volume."""

from contextlib import suppress
from itertools import combinations

import numpy as np
from scipy.sparse import csr_array

from thbcad.checks import Floats
from thbcad.sags.conic import Conic
from thbcad.sags.proven_approximation import MOST_CONTROL_POINTS, approximated
from thbcad.splines import BSplineSurface, KnotVector, gauss_rule, tensor_apply

CONIC_TOLERANCE = 1e-11  # mm, of conics up to 100 mm from the axis
HIGHER = 5  # the degree of conics that want many cubics: 280 control points per direction for 1900
FEW = 1000  # control points per direction that a conic may take in the degree of the sag
CONIC_SHARE = 1e-13  # of the half-width, of wider ones: rounding grows with them


def square_coefficients(kv: KnotVector) -> Floats:
    """Return the coefficients of x^2: c_i = mean of t_a t_b over pairs of the p inner knots of i.

    Exact for degree 2 and more (the polar form of x^2).
    """
    p = kv.degree
    pairs = list(combinations(range(1, p + 1), 2))
    products = (kv.knots[a : a + kv.dim] * kv.knots[b : b + kv.dim] for a, b in pairs)
    return sum(products, np.zeros(kv.dim)) / len(pairs)


def conic_graph(
    conic: Conic, kv_x: KnotVector, kv_y: KnotVector, sag: Floats | None = None
) -> BSplineSurface:
    """Return conic + sag as one BSplineSurface, on the given knots, refined where the conic needs it.

    Planes and paraboloids are exact but for rounding and keep the knots.  Other conics are within 1e-11 mm,
    or 1e-13 of a half-width beyond 100 mm; where 1000 control points per direction, or three times those of
    the knots, do not reach that, the degrees become 5 at least.

    sag : (kv_x.dim, kv_y.dim) or None.

    Raises ValueError : degree 1 (its surfaces have no normals along the knots), or a conic that needs more
        than 2000 control points per direction in degree 5, too.
    """
    if min(kv_x.degree, kv_y.degree) < 2:
        raise ValueError("a lens surface needs degree 2 or more: degree 1 has no normal along the knot lines")
    if conic.is_paraboloid:
        x2, y2 = square_coefficients(kv_x), square_coefficients(kv_y)
        heights = 0.5 / conic.radius * (x2[:, None] + y2[None, :])
        return BSplineSurface(kv_x, kv_y, heights if sag is None else heights + sag)
    tolerance = max(CONIC_TOLERANCE, CONIC_SHARE * max(kv_x.stop, kv_y.stop))
    own = BSplineSurface(kv_x, kv_y, np.zeros((kv_x.dim, kv_y.dim)) if sag is None else sag)
    try:
        # in a higher degree the sag itself takes up to three times its points
        most = min(max(FEW, 3 * kv_x.dim, 3 * kv_y.dim), MOST_CONTROL_POINTS)
        graph = approximated(conic, kv_x, kv_y, tolerance, most).surface
    except ValueError:
        own = own.elevate(max(kv_x.degree, HIGHER), max(kv_y.degree, HIGHER))
        graph = _of_higher_degree(conic, own, tolerance)
    if sag is None:
        return graph
    added = tensor_apply(
        own.kv_u.prolongation(graph.kv_u), own.kv_v.prolongation(graph.kv_v), own.coefficients
    )
    return BSplineSurface(graph.kv_u, graph.kv_v, graph.coefficients + added)


def _of_higher_degree(conic: Conic, over: BSplineSurface, tolerance: float) -> BSplineSurface:
    """Return a conic on the knots of a spline, refined; raise ValueError with the remedy where that fails."""
    if max(over.kv_u.dim, over.kv_v.dim) <= MOST_CONTROL_POINTS:
        with suppress(ValueError):
            return approximated(conic, over.kv_u, over.kv_v, tolerance).surface
    corner = float(np.hypot(over.kv_u.stop, over.kv_v.stop))
    ends = abs(conic.radius) / np.sqrt(1 + conic.constant) if conic.constant > -1 else np.inf
    where = f", at {corner / ends:.7g} of the radius where the conic ends" if np.isfinite(ends) else ""
    raise ValueError(
        f"{conic} cannot be written as a spline to {tolerance:g} mm with {MOST_CONTROL_POINTS} control "
        f"points per direction of degree {over.kv_u.degree}: the corner of the surface lies at r = "
        f"{corner:.6g} mm{where}; make the half-width smaller, or the radius larger"
    )


def graph_poles(graph: BSplineSurface, vertex: float, domain: BSplineSurface) -> BSplineSurface:
    """Return the graph as a BSplineSurface with poles (x, y, vertex + z).

    x and y of the poles are Greville-mapped, hence linear in the parameters; the parameters run
    over the rectangle of the graph `domain`.
    """
    poles = np.empty((*graph.coefficients.shape, 3))
    poles[..., 0] = graph.kv_u.greville()[:, None]
    poles[..., 1] = graph.kv_v.greville()[None, :]
    poles[..., 2] = vertex + graph.coefficients
    kv_u, kv_v = (_aligned(a, b) for a, b in ((graph.kv_u, domain.kv_u), (graph.kv_v, domain.kv_v)))
    return BSplineSurface(kv_u, kv_v, poles)


def graph_of_poles(surface: BSplineSurface) -> tuple[Floats, Floats, BSplineSurface] | None:
    """Return x (n_u,) and y (n_v,) of the poles of a surface (x(u), y(v), z(u, v)), and z as a graph.

    None where x of a pole depends on v, or y on u: no bit is left aside.
    """
    x, y, z = np.moveaxis(surface.coefficients, -1, 0)
    if (x != x[:, :1]).any() or (y != y[:1]).any():
        return None
    return x[:, 0], y[0], BSplineSurface(surface.kv_u, surface.kv_v, z)


def _aligned(kv: KnotVector, target: KnotVector) -> KnotVector:
    """Return `kv` mapped onto the interval of `target`; knots that agree but for rounding become equal."""
    mapped = kv.rescale(target.start, target.stop).knots
    near = target.breaks[
        np.clip(np.searchsorted(target.breaks, mapped - 1e-12 * target.stop), 0, target.spans)
    ]
    return KnotVector(kv.degree, np.where(np.abs(near - mapped) < 1e-12 * target.stop, near, mapped))


def gap_graph(front: BSplineSurface, rear: BSplineSurface, thickness: float) -> BSplineSurface:
    """Return thickness + rear - front at equal relative positions, as a spline over the rear's rectangle."""
    (kv_u, by_u), (kv_v, by_v) = (
        _common(a, b) for a, b in ((front.kv_u, rear.kv_u), (front.kv_v, rear.kv_v))
    )
    low, high = (tensor_apply(a, b, graph.coefficients) for a, b, graph in zip(by_u, by_v, (front, rear)))
    return BSplineSurface(kv_u, kv_v, thickness + high - low)


def _common(front: KnotVector, rear: KnotVector) -> tuple[KnotVector, tuple[csr_array, csr_array]]:
    """Return the knots of both over the rear's interval, and the operators from front and rear to them."""
    front = _aligned(front, rear)
    both = rear.merge(front)
    return both, (front.prolongation(both), rear.prolongation(both))


def volume_between(front: BSplineSurface, rear: BSplineSurface, thickness: float) -> float:
    """Return the volume between two graphs whose rims are joined by ruled edges.

    The solid is X(s, t, w) = (1 - w) F(s, t) + w R(s, t), (s, t) in [-1, 1]^2, w in [0, 1];
    with half-widths a(w), b(w) linear in w its Jacobian is
    a b z_w - a t b' z_t - b s a' z_s, a polynomial on every cell: Gauss quadrature is exact.
    """
    halves = [(g.kv_u.stop, g.kv_v.stop) for g in (front, rear)]
    nodes = []
    for d in (0, 1):
        knots = [(g.kv_u, g.kv_v)[d] for g in (front, rear)]
        breaks = np.unique(np.concatenate([kv.breaks / kv.stop for kv in knots]))
        nodes.append(gauss_rule(breaks, max(kv.degree for kv in knots) // 2 + 2))
    (s, ws), (t, wt) = nodes
    total = 0.0
    for w, ww in zip(*gauss_rule(np.array([0.0, 1.0]), 2)):
        (af, bf), (ar, br) = halves
        a, b, da, db = (1 - w) * af + w * ar, (1 - w) * bf + w * br, ar - af, br - bf
        z_w = thickness + rear.grid(s * ar, t * br) - front.grid(s * af, t * bf)
        jacobian = a * b * z_w
        if da or db:
            z_s, z_t = (
                (1 - w) * scale_f * front.grid(s * af, t * bf, d) + w * scale_r * rear.grid(s * ar, t * br, d)
                for d, scale_f, scale_r in (((1, 0), af, ar), ((0, 1), bf, br))
            )
            jacobian = jacobian - a * db * t[None, :] * z_t - b * da * s[:, None] * z_s
        total += ww * (ws @ jacobian @ wt)
    return float(total)
