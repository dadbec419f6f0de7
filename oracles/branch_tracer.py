"""Closed lenses for the slow branch tracer: a convex polyhedron, level rims with rounded corners, a mesh."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from optics.light.tracing import FATES
from oracles.polarised_faces import split_fields, unpolarised
from thbcad.outlines import Outline

INDEX = 1.5
STEP = 1e-6  # of differences along rims, of half a side


def half_spaces(front, rear, thickness):
    """Return (normals (6, 3), offsets (6,)) of a frustum, in the order front, rear, edges."""
    normals, offsets = [(0, 0, -1), (0, 0, 1)], [0.0, thickness]
    for axis in (0, 1):
        for sign in (1, -1):
            normal = np.zeros(3)
            normal[axis], normal[2] = sign, -(rear[axis] - front[axis]) / thickness
            normals.append(normal / np.linalg.norm(normal))
            offsets.append(front[axis] / np.linalg.norm(normal))
    return np.array(normals), np.array(offsets)


class Frustum:
    """The next face of a convex polyhedron."""

    def __init__(self, *shape):
        self.normals, self.offsets = half_spaces(*shape)

    def __call__(self, origin, direction, inside, own):
        """Return (point, outward normal, class of the face, the face) or None."""
        rate, room = self.normals @ direction, self.offsets - self.normals @ origin
        with np.errstate(divide="ignore", invalid="ignore"):
            t = room / rate
        leaves, enters = rate > 0, rate < 0
        if inside:
            t = np.where(leaves & (np.arange(6) != own), t, np.inf)
            face = int(t.argmin())
        else:
            face = int(np.where(enters, t, -np.inf).argmax())
            if own is not None or t[face] < 0 or (t[leaves] < t[face]).any() or (room[rate == 0] < 0).any():
                return None
        return origin + t[face] * direction, self.normals[face], min(face, 2), face


class LevelSolid:
    """The next face of a lens between planes z = 0 and z = thickness whose corners are rounded.

    Half-widths h and semi-axes r h of the corners are linear in z, so that sides and corners of all sections
    are met at the roots of polynomials in the length of the ray: |x| = hx, and with the distances p and q
    from a corner's middle (p ry hy)^2 + (q rx hx)^2 = (rx hx ry hy)^2.
    """

    def __init__(self, front, rear, relative, thickness):
        self.front, self.rates = np.array(front), (np.array(rear) - front) / thickness
        self.relative, self.thickness = relative, thickness

    def __call__(self, origin, direction, inside, own):
        """Return (point, outward normal, class of the face, the face) or None."""
        found = []
        for face, (z, outward) in enumerate(((0.0, -1.0), (self.thickness, 1.0))):
            if direction[2] * outward * (1 if inside else -1) > 0:
                t = (z - origin[2]) / direction[2]
                x, y, _ = point = origin + t * direction
                h = self.front + z * self.rates
                if Outline(h, h * self.relative).contains(x, y):
                    found.append((t, point, np.array([0.0, 0.0, outward]), face, face))
        z = Polynomial([origin[2], direction[2]])
        h = [a + rate * z for a, rate in zip(self.front, self.rates)]
        for signs in ((1, 1), (-1, 1), (-1, -1), (1, -1), (1, 0), (-1, 0), (0, 1), (0, -1)):
            found += self._wall(origin, direction, inside, h, np.array(signs))
        found = [f for f in found if f[0] > -1e-10]
        return min(found, key=lambda f: f[0])[1:] if found else None

    def _wall(self, origin, direction, inside, h, signs):
        """Return meetings with a piece of the wall: a corner by its signs, or a side, one of them 0."""
        p, q = (Polynomial([o, d]) * s for o, d, s in zip(origin, direction, signs))
        rx, ry = self.relative
        if signs.all():
            p, q = p - (1 - rx) * h[0], q - (1 - ry) * h[1]
            a, b = rx * h[0], ry * h[1]
            over = (p * b) ** 2 + (q * a) ** 2 - (a * b) ** 2
        else:
            over = p - h[0] if signs[0] else q - h[1]
        roots = over.roots()
        for _ in range(3):  # of Newton's method
            roots = roots - over(roots) / over.deriv()(roots)
        for t in roots[abs(roots.imag) < 1e-9].real:
            point = origin + t * direction
            width = self.front + point[2] * self.rates
            beyond = (
                np.where(signs, signs * point[:2], abs(point[:2])) > (1 - np.array(self.relative)) * width
            )
            if (
                (beyond == (signs != 0)).all()
                and 0 <= point[2] <= self.thickness
                and (over.deriv()(t) > 0) == inside
            ):
                yield t, point, self._normal(point, signs, width), 2, 2

    def _normal(self, point, signs, width):
        if not signs.all():
            slope = -abs(signs) @ self.rates
        else:
            semi = np.array(self.relative) * width
            corner = (signs * point[:2] - width + semi) / semi
            signs, slope = (
                signs * corner / semi,
                -(corner * (signs * point[:2] / semi * self.rates / width)).sum(),
            )
        normal = np.array([*signs, slope], dtype=float)
        return normal / np.linalg.norm(normal)


def trace_one(solid, ray, target, threshold, absorbing_wall=False, landings=None):
    """Return the flux of one ray by fate, (len(FATES),), branch by branch.

    solid : (origin, direction, inside, own face) -> (point, normal, 0 front, 1 rear or 2 edge, face) or None.
    landings : a list to which x, y and flux of branches in the target plane are appended.
    """
    flux = dict.fromkeys(FATES, 0.0)
    start, direction, power = ray
    stack = [(start, direction, power, False, None, None, 0, unpolarised(direction[None]))]
    while stack:
        origin, d, share, inside, own, left, met, fields = stack.pop()
        meeting = solid(origin, d, inside, own)
        if meeting is None:
            fate = "failed" if inside else escape(origin, d, left, target)
            flux[fate] += share
            if landings is not None and fate.endswith("_target"):
                length = (target.receiver.pose.shift[2] - origin[2]) / d[2]
                landings.append((*(origin + length * d)[:2], share))
            continue
        if met == 64:
            flux["trapped"] += share
            continue
        point, normal, kind, face = meeting
        if absorbing_wall and kind == 2:
            flux["blocked"] += share
            continue
        normal = normal if inside else -normal
        eta = INDEX if inside else 1 / INDEX
        refracted, reflected = split_fields(fields, d[None], normal[None], np.array([eta]))
        onward, passing, (passed,) = refracted
        if passed > 0:
            exit_face = ("front_", "", "edges_")[kind] if inside else left
            branch = (point, onward[0], passed * share, not inside, face, exit_face, met + 1, passing)
            drop(stack, branch, flux, threshold * power)
        mirrored, staying = reflected
        outside = left if left == "" else left or "outside"
        branch = (point, mirrored[0], share - passed * share, inside, face, outside, met + 1, staying)
        drop(stack, branch, flux, threshold * power)
    return np.array([flux[name] for name in FATES])


def drop(stack, branch, flux, least):
    if branch[2] <= least:
        flux["trapped"] += branch[2]
    else:
        stack.append(branch)


def escape(origin, d, left, target):
    """Return the fate of light that leaves: `left` is None (nothing met), "outside", or the prefix of the
    last exit."""
    if left is None or left == "outside":
        return "beside_lens" if left is None else "reflected_outside"
    if d[2] <= 0 or origin[2] > target.receiver.pose.shift[2]:
        return "back"
    x, y = (origin + d * (target.receiver.pose.shift[2] - origin[2]) / d[2])[:2]
    return left + (
        "on_target" if abs(x) <= target.half_width[0] and abs(y) <= target.half_width[1] else "off_target"
    )


def traced_one_by_one(solid, rays, target, threshold, **settings):
    each = zip(rays.origin.T, rays.direction.T, rays.flux)
    return np.array([trace_one(solid, ray, target, threshold, **settings) for ray in each]).T


def edge_gap(lens):
    """Return the least height of sampled points of the edges above the front and below the rear, mm."""
    mesh = MeshSolid(lens, 4)
    w = np.r_[1e-3, np.linspace(0, 1, 60)[1:-1], 1 - 1e-3]
    s, w = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, 121), w))
    least = np.inf
    for kind in range(2, 6):
        points = mesh.point(np.full(s.size, kind), s, w)
        for surface, vertex, side in ((lens.front, 0.0, 1), (lens.rear, lens.thickness, -1)):
            over = (abs(points[:, :2]) <= surface.half_width).all(axis=1)
            x, y, z = points[over].T
            least = min(least, np.min(side * (z - vertex - surface(x, y)), initial=np.inf))
    return least


class MeshSolid:
    """A closed lens as triangles: facets are met by Moeller and Trumbore's test, normals are those of the
    surfaces."""

    def __init__(self, lens, count=40):
        self.lens = lens
        s = np.linspace(-1, 1, count + 1)
        w = np.linspace(0, 1, count // 4 + 1)
        pieces = [(kind, *np.meshgrid(s, s if kind < 2 else w, indexing="ij")) for kind in range(6)]
        corners, parameters, kinds = [], [], []
        for kind, a, b in pieces:
            points = self.point(np.full(a.size, kind), a.ravel(), b.ravel()).reshape(*a.shape, 3)
            both = np.stack([a, b], axis=-1)
            for grid, out in ((points, corners), (both, parameters)):
                p, q, r, t = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
                out += [
                    np.stack(three, axis=2).reshape(-1, 3, grid.shape[2]) for three in ((p, q, r), (p, r, t))
                ]
            kinds.append(np.full(2 * (a.shape[0] - 1) * (a.shape[1] - 1), kind))
        self.corners, self.parameters, self.kinds = (
            np.concatenate(part) for part in (corners, parameters, kinds)
        )
        first, second = (self.corners[:, k] - self.corners[:, 0] for k in (1, 2))
        normal = np.cross(first, second)
        middle = self.normal(self.kinds, *self.parameters.mean(axis=1).T)
        self.sides = np.sign(np.sum(normal * middle, axis=1))

    def rims(self, kind, s):
        """Return the ends of the rulings s of the edges +x, -x, +y, -y (2 to 5), each (n, 3), and their
        derivatives by s."""
        sign, on_x = np.where(kind % 2 == 0, 1.0, -1.0), kind < 4
        a, b = self.plan(np.where(on_x, sign, s), np.where(on_x, s, sign))
        after = self.plan(np.where(on_x, sign, s + STEP), np.where(on_x, s + STEP, sign))
        before = self.plan(np.where(on_x, sign, s - STEP), np.where(on_x, s - STEP, sign))
        along = (np.array(after) - before) / (2 * STEP)
        ends = []
        for surface, vertex in ((self.lens.front, 0.0), (self.lens.rear, self.lens.thickness)):
            hx, hy = surface.half_width
            x, y, dx, dy = a * hx, b * hy, along[0] * hx, along[1] * hy
            slope = surface(x, y, (1, 0)) * dx + surface(x, y, (0, 1)) * dy
            ends.append(np.column_stack([x, y, vertex + surface(x, y)]))
            ends.append(np.column_stack([dx, dy, slope]))
        return ends

    def plan(self, a, b):
        """Return where points of the square [-1, 1]^2 lie on front and rear, relative to the half-widths."""
        if self.lens.front.outline.is_rectangle:
            return a, b
        square = np.maximum(abs(a), abs(b))
        scale = square / np.maximum(
            self.lens.front.outline.gauge(
                *(np.array([a, b]) * np.array(self.lens.front.half_width)[:, None])
            ),
            1e-300,
        )
        return a * scale, b * scale

    def point(self, kind, a, b):
        if kind[0] >= 2:
            front, _, rear, _ = self.rims(kind, a)
            return (1 - b[:, None]) * front + b[:, None] * rear
        surface, vertex = ((self.lens.front, 0.0), (self.lens.rear, self.lens.thickness))[kind[0]]
        x, y = (c * h for c, h in zip(self.plan(a, b), surface.half_width))
        return np.column_stack([x, y, vertex + surface(x, y)])

    def normal(self, kind, a, b):
        """Return outward unit normals, (n, 3)."""
        normals = np.zeros((len(a), 3))
        for which, surface, sign in ((0, self.lens.front, -1), (1, self.lens.rear, 1)):
            m = kind == which
            x, y = (c[m] * h for c, h in zip(self.plan(a, b), surface.half_width))
            if m.any():
                normals[m] = sign * np.column_stack(
                    [-surface(x, y, (1, 0)), -surface(x, y, (0, 1)), np.ones_like(x)]
                )
        m = kind >= 2
        if m.any():
            front, front_s, rear, rear_s = self.rims(kind[m], a[m])
            w = b[m][:, None]
            normals[m] = np.cross((1 - w) * front_s + w * rear_s, rear - front)
            outward = np.where(kind[m] < 4, 0, 1), np.where(kind[m] % 2 == 0, 1.0, -1.0)
            normals[m] *= (np.sign(normals[m][np.arange(m.sum()), outward[0]]) * outward[1])[:, None]
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def __call__(self, origin, direction, inside, own):
        base = self.corners[:, 0]
        first, second = self.corners[:, 1] - base, self.corners[:, 2] - base
        across = np.cross(direction, second)
        volume = np.sum(first * across, axis=1)  # negative where the ray passes along first x second
        outward = -volume * self.sides > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            offset = origin - base
            u = np.sum(offset * across, axis=1) / volume
            turned = np.cross(offset, first)
            v = turned @ direction / volume
            t = np.sum(second * turned, axis=1) / volume
        hit = (outward == inside) & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 1e-9)
        if own is not None:
            hit[own] = False
        if not hit.any():
            return None
        k = int(np.where(hit, t, np.inf).argmin())
        weights = np.array([1 - u[k] - v[k], u[k], v[k]])
        a, b = (np.clip(c, -1, 1) for c in weights @ self.parameters[k])
        normal = self.normal(self.kinds[k : k + 1], np.array([a]), np.array([b]))[0]
        return origin + t[k] * direction, normal, min(int(self.kinds[k]), 2), k
