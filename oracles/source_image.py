"""Irradiance under a uniform Lambertian rectangle through a lens, by the image of the source that a target
point sees.

From a point t of the target the source is seen through those points r of the rear z(x, y) whose rays, traced
backwards, meet it.  With the radiance L = Phi / (pi A) and the light's direction e = (t - r) / |t - r|,

    E(t) = L integral of T e_z (e . (-z_x, -z_y, 1)) / |t - r|^2 dx dy   over these points of z(x, y).

T is what both faces pass (unpolarised at each).  If T were 1 this would be L times the area that the outline
of the source's image encloses in direction cosines, a contour integral (Stokes); T varies, so the enclosed
area is integrated.  Cells of the rear are traced at their corners; those whose corners see near the source
are cut into pieces, whose middles are traced.  Nothing is random, and no ray is wasted on light that lands
elsewhere.  Light that enters the glass again behind the rear is not followed.

The rear is a spline evaluated by scipy's B-splines on the coefficients of the lens; the front is a conic, met
in closed form.  No code is shared with the tracer.

Source: S. Hirst, J. Muschaweck, P. Benitez, Fast, deterministic computation of irradiance values using a
single extended source in 3D, Optics Express 26 (2018), A651.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

COARSE, FINE = 256, 12  # cells of the rear in each direction; pieces of a cell that may see the source
NEAR = 1.0  # of the extent that a cell sees: how far beyond it is looked for the source
STRIP = 1 << 17  # pieces at a time


@dataclass(frozen=True, eq=False)
class Scene:
    """A uniform Lambertian rectangle and a lens with a conic front.

    graph : the rear over its vertex plane, a tensor-product spline with knots `kv_u`, `kv_v` and coefficients
    radius, constant : of the front, vertex at z = 0.  half_width : of the front, mm
    thickness, index : of the lens.  target : z of the target plane, mm
    source : half-widths, mm.  distance : of the source before the front's vertex, mm.  flux : W
    """

    graph: object
    radius: float
    constant: float
    half_width: tuple[float, float]
    thickness: float
    index: float
    target: float
    source: tuple[float, float]
    distance: float
    flux: float

    @classmethod
    def of(cls, system, lens):
        """Return the scene of a system (its source and target) and a lens."""
        source, front = system.problem.source, lens.front
        assert source.kind == "lambertian"
        assert source.half_angle == 90.0
        assert source.profile == "uniform"
        assert front.sag is None or not front.sag.coefficients.any()
        return cls(
            graph=lens.graphs()[1],
            radius=front.conic.radius,
            constant=front.conic.constant,
            half_width=front.half_width,
            thickness=lens.thickness,
            index=lens.index,
            target=system.problem.lens.thickness + system.problem.throw,
            source=source.half_width,
            distance=source.distance,
            flux=source.flux,
        )


class Rows:
    """Values and first derivatives of the B-splines of one direction at the lines of a grid.

    lines : (n,).  After `start[k]` come the p + 1 functions of line k, values[k] and slopes[k].
    """

    def __init__(self, kv, lines):
        knots, p = np.asarray(kv.knots), kv.degree
        self.lines = lines
        span = np.clip(np.searchsorted(knots, lines, "right") - 1, p, len(knots) - p - 2)
        self.start = span - p
        functions = BSpline(knots, np.eye(len(knots) - p - 1), p)
        chosen = np.arange(len(lines))[:, None], self.start[:, None] + np.arange(p + 1)
        self.values, self.slopes = functions(lines)[chosen], functions(lines, nu=1)[chosen]


class SourceImage:
    """The irradiance of a `Scene`; coarse : cells of the rear in each direction, fine : pieces of a cell."""

    def __init__(self, scene, coarse=COARSE, fine=FINE):
        self.scene, self.coarse, self.fine = scene, coarse, fine
        graph = scene.graph
        ends = [(kv.start, kv.stop) for kv in (graph.kv_u, graph.kv_v)]
        self._area = np.prod([(b - a) / (coarse * fine) for a, b in ends])
        corners = [np.linspace(a, b, coarse + 1) for a, b in ends]
        middles = [a + (b - a) * (np.arange(coarse * fine) + 0.5) / (coarse * fine) for a, b in ends]
        self._fine = [Rows(kv, x) for kv, x in zip((graph.kv_u, graph.kv_v), middles)]
        rows = [Rows(kv, x) for kv, x in zip((graph.kv_u, graph.kv_v), corners)]
        i, j = (k.ravel() for k in np.meshgrid(*(np.arange(coarse + 1),) * 2, indexing="ij"))
        self._corners = self._rear(rows, i, j)

    def __call__(self, points):
        """Return the irradiance at points (n, 2) of the target plane, W/mm^2, (n,)."""
        scene = self.scene
        radiance = scene.flux / (np.pi * 4 * scene.source[0] * scene.source[1])
        return radiance * np.array([self._projected(point) for point in np.atleast_2d(points)])

    def _projected(self, point):
        """Return the integral of the module without L, sr."""
        i, j = np.nonzero(self._seen(point))
        steps = np.arange(self.fine)
        total, most = 0.0, max(1, STRIP // self.fine**2)
        for first in range(0, len(i), most):
            part = slice(first, first + most)
            rows = (i[part, None, None] * self.fine + steps[:, None], j[part, None, None] * self.fine + steps)
            k, m = (a.ravel() for a in np.broadcast_arrays(*rows))
            x, y, weight = self._traced(self._rear(self._fine, k, m), point)
            shape = -1, self.fine, self.fine
            inside = [_inside(v.reshape(shape), half) for v, half in zip((x, y), self.scene.source)]
            total += (weight.reshape(shape) * inside[0] * inside[1]).sum()
        return total * self._area

    def _seen(self, point):
        """Return which cells may see the source, (coarse, coarse) bool."""
        x, y, weight = self._traced(self._corners, point)
        near = np.ones((self.coarse, self.coarse), dtype=bool)
        for values, half in zip((x, y), self.scene.source):
            net = np.where(weight > 0, values, np.nan).reshape(self.coarse + 1, -1)
            corners = np.stack([net[:-1, :-1], net[1:, :-1], net[:-1, 1:], net[1:, 1:]])
            low, high = np.fmin.reduce(corners), np.fmax.reduce(corners)
            room = NEAR * (high - low)
            near &= (low - room <= half) & (high + room >= -half)  # False where no corner sees anything
        return near

    def _rear(self, rows, i, j):
        """Return x, y, z, z_x, z_y of the rear at lines i and j of two `Rows`, each (n,)."""
        u, v = rows
        net = self.scene.graph.coefficients
        at_u, at_v = (r.start[k][:, None] + np.arange(r.values.shape[1]) for r, k in ((u, i), (v, j)))
        near = net[at_u[:, :, None], at_v[:, None, :]]
        by_v = np.einsum("nab,nb->na", near, v.values[j])
        z = np.einsum("na,na->n", by_v, u.values[i])
        z_x = np.einsum("na,na->n", by_v, u.slopes[i])
        z_y = np.einsum("nab,na,nb->n", near, u.values[i], v.slopes[j])
        return u.lines[i], v.lines[j], self.scene.thickness + z, z_x, z_y

    def _traced(self, rear, point):
        """Return where rays that reach a target point start in the source plane, x and y, and their weights.

        rear : x, y, z, z_x, z_y, each (n,).  The weight is the integrand of the module, 0 for no ray.
        """
        s = self.scene
        x, y, z, z_x, z_y = rear
        away = np.stack([point[0] - x, point[1] - y, s.target - z])
        square = (away**2).sum(axis=0)
        e = away / np.sqrt(square)
        facing = e[2] - e[0] * z_x - e[1] * z_y
        length = np.sqrt(1 + z_x**2 + z_y**2)
        with np.errstate(invalid="ignore", divide="ignore"):
            normal = np.stack([-z_x, -z_y, np.ones_like(z)]) / length
            inner, passed = _refracted(e, normal, facing / length, 1 / s.index)
            front = np.stack([x, y, z]) - self._back(np.stack([x, y, z]), inner) * inner
            normal = self._front_normal(front)
            outer, passed_front = _refracted(inner, normal, (inner * normal).sum(axis=0), s.index)
            start = front[:2] - (front[2] + s.distance) / outer[2] * outer[:2]
            weight = passed * passed_front * e[2] * facing / square
            good = (facing > 0) & (outer[2] > 0) & (front[2] > -s.distance) & (weight > 0)
            good &= (np.abs(front[0]) <= s.half_width[0]) & (np.abs(front[1]) <= s.half_width[1])
        return start[0], start[1], np.where(good, weight, 0.0)

    def _back(self, start, direction):
        """Return how far behind a point in the glass a ray came through the front, NaN where it did not.

        The least positive root of F(start - t direction), F = 2 z - c (x^2 + y^2 + (1 + K) z^2), c = 1 / R.
        """
        c, k = 1 / self.scene.radius, 1 + self.scene.constant
        stretch = np.array([1.0, 1.0, k])[:, None]
        a = -c * (stretch * direction**2).sum(axis=0)
        half = c * (stretch * start * direction).sum(axis=0) - direction[2]
        rest = 2 * start[2] - c * (stretch * start**2).sum(axis=0)
        return rest / (np.sqrt(half**2 - a * rest) - half)

    def _front_normal(self, points):
        """Return the unit normals of the front towards +z, (3, n)."""
        c, k = 1 / self.scene.radius, 1 + self.scene.constant
        slope = np.stack([-c * points[0], -c * points[1], 1 - c * k * points[2]])
        return slope / np.sqrt((slope**2).sum(axis=0))


def _inside(values, half):
    """Return which part of every piece has |value| <= half, (cells, fine, fine), 0 to 1.

    The border is blurred along itself by the extent of one piece, symmetrically, so that pieces that it cuts
    are right in the mean and the sum errs with the square of their size.
    """
    steps = [np.nan_to_num(abs(np.gradient(values, axis=axis))) for axis in (1, 2)]
    room = half - np.nan_to_num(abs(values), nan=np.inf)
    return np.clip(0.5 + room / np.maximum(steps[0] + steps[1], 1e-12 * half), 0, 1)


def _refracted(direction, normal, cosine, ratio):
    """Return (direction, transmittance) on the other side of a face, NaN where light is reflected totally.

    cosine : of the given side.  ratio : index of the given side over that of the other.
    """
    other = np.sqrt(1 - ratio**2 * (1 - cosine**2))
    s = (ratio * cosine - other) / (ratio * cosine + other)
    p = (cosine - ratio * other) / (cosine + ratio * other)
    return ratio * direction + (other - ratio * cosine) * normal, 1 - (s**2 + p**2) / 2


def pixel_irradiance(image, pixels, screen, order):
    """Return (irradiance of box pixels, error estimates), W/mm^2, each (n,).

    pixels : (n, 2) int, row and column.  order : of Gauss's rule in each direction of a pixel.
    The estimate is the change from the rule of one order less.
    """
    x, y = screen.centres
    rules = []
    for n in (order - 1, order):
        nodes, weights = np.polynomial.legendre.leggauss(n)
        rules.append(
            [np.stack(np.meshgrid(nodes, nodes)).reshape(2, -1).T, np.outer(weights, weights).ravel()]
        )
    found = []
    for row, column in pixels:
        middle, half = np.array([x[column], y[row]]), np.divide(screen.pitch, 2)
        found.append([image(middle + nodes * half) @ weights / 4 for nodes, weights in rules])
    coarser, finer = np.array(found).T
    return finer, abs(finer - coarser)
