"""An independent tracer: numpy and scipy on the poles and knots of a STEP file.

It shares no code with the optimiser's tracer: surfaces are general parametric splines evaluated
by scipy's NdBSpline, rays are intersected by Newton's method in the surface parameters, with planes and
conics in closed form, and refraction uses the vector form of Snell's law.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import NdBSpline

from optics.base.runtime import NumericalError
from optics.exchange.verification.conic_face import MEETS, ROOM, ConicFace, FaceRim, Floats, Meetings
from optics.light.tracing import LandingPoints
from optics.scene.receivers import Receiver, Screen
from thbcad.lens import OpticalForm
from thbcad.sags import PlacedConic
from thbcad.splines import BSplineSurface, KnotVector

HALVINGS = 12  # of steps in which a ray may fall through the face, before Newton's method
SAMPLES = 33  # along every ray, from where it enters the face's box to where it leaves it
STILL = 1e-12  # of a direction: components that count as zero
NEWTON_STEPS, NEWTON_TOLERANCE = 20, 1e-12
AT_ONCE = 20_000  # rays


class OpticalFaces(Protocol):
    """Front and rear of a STEP file, as `SolidFile` has them, mm."""

    @property
    def front(self) -> OpticalForm: ...

    @property
    def rear(self) -> OpticalForm: ...


class ParametricFace:
    """S(u, v) with poles (n_u, n_v, 3), evaluated by scipy."""

    def __init__(self, surface: BSplineSurface) -> None:
        knots = surface.kv_u.knots, surface.kv_v.knots
        degrees = surface.kv_u.degree, surface.kv_v.degree
        self._spline = NdBSpline(knots, surface.coefficients, degrees)
        self._height = NdBSpline(knots, surface.coefficients[..., 2], degrees)
        self.low = np.array([knots[0][0], knots[1][0]])
        self.high = np.array([knots[0][-1], knots[1][-1]])
        poles = surface.coefficients.reshape(-1, 3)
        self.width = float(np.ptp(poles[:, 0]))
        room = [0.0, 0.0, ROOM * self.width]
        self._box = poles.min(axis=0) - room, poles.max(axis=0) + room
        heights = surface.coefficients[..., 2]
        self._steepest = np.array(
            [_steepest(kv, z) for kv, z in ((surface.kv_u, heights), (surface.kv_v, heights.T))]
        )

    def start(self, points: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters where rays first fall through the face, to a step's width.

        x and y are taken as linear in the parameters: a guess that Newton's method corrects.
        Rays parallel to z need no search.

        points, directions : (n, 3).
        """
        uv = self._below(points[:, :2])
        slanted = (np.abs(directions[:, :2]) >= STILL).any(axis=1)
        if slanted.any():
            uv[slanted] = self._search(points[slanted], directions[slanted])
        return uv

    def _below(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the parameters at (x, y), (..., 2), of the rim where they lie beside the face."""
        fraction = np.clip((points - self._box[0][:2]) / (self._box[1] - self._box[0])[:2], 0, 1)
        return self.low + fraction * (self.high - self.low)

    def _search(self, points: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the parameters where slanted rays first fall through the face, to a step's width.

        Steps are halved where f = height of the face - height of the ray may reach zero: where it changes its
        sign, or is less at both ends together than the length times the greatest slope.
        """
        first, last = self._within_box(points, directions)
        per_length = (self.high - self.low) / (self._box[1] - self._box[0])[:2]
        steepest = np.abs(directions[:, :2]) @ (self._steepest * per_length) + np.abs(directions[:, 2])

        def above(ray: NDArray[np.int64], t: Floats) -> Floats:
            here = points[ray] + t[:, None] * directions[ray]
            return self._height(self._below(here[:, :2])) - here[:, 2]

        ray, k = (a.ravel() for a in np.indices((len(points), SAMPLES)))
        t = first[ray] + (last - first)[ray] * (k / (SAMPLES - 1))
        f = above(ray, t)
        steps = np.array(
            [a.reshape(-1, SAMPLES)[:, w].ravel() for a in (t, f) for w in (np.s_[:-1], np.s_[1:])]
        )
        nearest = np.abs(steps[2]).reshape(len(points), -1).argmin(axis=1) + np.arange(len(points)) * (
            SAMPLES - 1
        )
        best = (steps[0] + steps[1])[nearest] / 2
        ray = ray[k < SAMPLES - 1]
        for halvings in range(HALVINGS + 1):
            low, high, f_low, f_high = steps
            falls = (f_low > 0) & (f_high <= 0)
            fall = np.full(len(points), np.inf)
            np.minimum.at(fall, ray[falls], low[falls])
            unsafe = (f_low > 0) & (f_low + f_high <= steepest[ray] * (high - low))
            chosen = (falls | unsafe) & (low <= fall[ray])
            ray, steps = ray[chosen], steps[:, chosen]
            if halvings < HALVINGS:
                low, high, f_low, f_high = steps
                middle = (low + high) / 2
                f_middle = above(ray, middle)
                steps = np.concatenate(
                    [[low, middle, f_low, f_middle], [middle, high, f_middle, f_high]], axis=1
                )
                ray = np.concatenate([ray, ray])
        falls = steps[3] <= 0
        best[ray[falls]] = (steps[0] + steps[1])[falls] / 2
        return self._below((points + best[:, None] * directions)[:, :2])

    def behind(self, points: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which rays come into the face's box above the face: they pass its rim."""
        here = points + self._within_box(points, directions)[0][:, None] * directions
        return here[:, 2] - self._height(self._below(here[:, :2])) > MEETS * self.width

    def _within_box(
        self, points: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the ray parameters at which rays enter and leave the face's box."""
        still = np.abs(directions) < STILL
        speed = np.where(still, 1.0, directions)
        low, high = self._box
        ends = np.stack(
            [
                np.where(still, -np.inf, (low - points) / speed),
                np.where(still, np.inf, (high - points) / speed),
            ]
        )
        return np.maximum(ends.min(axis=0).max(axis=1), 0.0), ends.max(axis=0).min(axis=1)

    def jet(self, uv: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return S, S_u, S_v at (n, 2) parameters, each (n, 3)."""
        return [self._spline(uv, nu=nu) for nu in ((0, 0), (1, 0), (0, 1))]


def _steepest(kv: KnotVector, heights: Floats) -> float:
    """Return a bound of the derivative by the first parameter, from differences of the poles' heights."""
    widths = kv.knots[kv.degree + 1 : -1] - kv.knots[1 : -kv.degree - 1]
    return float(np.max(kv.degree * np.abs(np.diff(heights, axis=0)) / widths[:, None]))


def trace_step(
    step: OpticalFaces,
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
    flux: ArrayLike,
    index: float,
    target: Receiver,
    rims: Sequence[FaceRim] = (),
) -> LandingPoints:
    """Trace rays through the two faces of a STEP file to a target.

    origins, directions : (n, 3) float, mm and unit vectors.  flux : (n,) or float, W before the lens.
    rims : of front and rear, where the faces do not fill their rectangles.
    Far-field points are the angles atan(d_x / d_z), atan(d_y / d_z) in degrees.
    """
    points = origins
    weight = np.broadcast_to(np.asarray(flux, dtype=float), len(origins)).copy()
    for k, (surface, eta) in enumerate(((step.front, 1 / index), (step.rear, index))):
        points, normals, met = _meet(surface, points, directions)
        if rims:
            met = met & rims[k].holds(points[:, :2])
        directions, transmittance = _refract(directions, normals, eta)
        weight *= np.where(met, transmittance, 0.0)
    landing, meets = last_step(points, directions, target)
    arrives = (weight > 0) & (directions[:, 2] > 0) & meets
    return LandingPoints(np.where(arrives[:, None], landing, np.nan), np.where(arrives, weight, 0.0))


def last_step(
    points: NDArray[np.float64], directions: NDArray[np.float64], target: Receiver
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return where rays land, (n, 2), mm or degrees, and whether they come from before the target, (n,).

    points, directions : (n, 3), in the frame of the lens.
    """
    own, along = (points - target.pose.shift) @ target.pose.rotation, directions @ target.pose.rotation
    meets = along[:, 2] > 0
    across = along[:, :2] / np.where(meets, along[:, 2], 1.0)[:, None]
    if target.far_field:
        return np.degrees(np.arctan(across)), meets
    return own[:, :2] - own[:, 2:] * across, meets


def deposit(points: NDArray[np.float64], flux: NDArray[np.float64], screen: Screen) -> NDArray[np.float64]:
    """Return the irradiance by bilinear weights between pixel centres, (rows, columns), W/mm^2."""
    good = np.isfinite(points).all(axis=1) & (flux > 0)
    (sx, ox), (sy, oy) = screen.pixel_map()
    column, row = points[good, 0] * sx + ox - 0.5, points[good, 1] * sy + oy - 0.5
    rows, columns = screen.padded
    image = np.zeros((rows, columns))
    c, r = np.floor(column).astype(int), np.floor(row).astype(int)
    for dr in (0, 1):
        for dc in (0, 1):
            weight = (1 - np.abs(row - r - dr)) * (1 - np.abs(column - c - dc)) * flux[good]
            inside = (r + dr >= 0) & (r + dr < rows) & (c + dc >= 0) & (c + dc < columns)
            np.add.at(image, (r[inside] + dr, c[inside] + dc), weight[inside])
    return image / screen.pixel_area


def _meet(surface: OpticalForm, points: NDArray[np.float64], directions: NDArray[np.float64]) -> Meetings:
    """Return (points, unit normals towards +z, met) of rays on a face."""
    if isinstance(surface, PlacedConic):
        return ConicFace(surface).intersect(points, directions)
    return _intersect(ParametricFace(surface), points, directions)


def _intersect(
    face: ParametricFace, points: NDArray[np.float64], directions: NDArray[np.float64]
) -> Meetings:
    """Return (points, unit normals towards +z, met) of rays on a spline, part by part."""
    parts = [slice(k, k + AT_ONCE) for k in range(0, len(points), AT_ONCE)]
    meetings = [_newton(face, points[k], directions[k], face.start(points[k], directions[k])) for k in parts]
    on_face, normals, met = (np.concatenate(column) for column in zip(*meetings))
    return on_face, normals, met & ~face.behind(points, directions)


def _newton(
    face: ParametricFace,
    points: NDArray[np.float64],
    directions: NDArray[np.float64],
    uv: NDArray[np.float64],
) -> Meetings:
    """Return (points, unit normals towards +z, met) by Newton's method from the parameters uv.

    It solves a . (S - o) = b . (S - o) = 0 with a, b perpendicular to the ray.  Meetings behind the origin or
    on the far side of the face do not count.
    """
    helper = np.where(np.abs(directions[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    a = np.cross(directions, helper)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(directions, a)
    size = np.abs(face.high - face.low).max()
    for _ in range(NEWTON_STEPS):
        s, su, sv = face.jet(uv)
        f, g = _dot(a, s - points), _dot(b, s - points)
        fu, fv, gu, gv = _dot(a, su), _dot(a, sv), _dot(b, su), _dot(b, sv)
        determinant = fu * gv - fv * gu
        step = np.column_stack([gv * f - fv * g, fu * g - gu * f]) / determinant[:, None]
        uv = np.clip(uv - step, face.low, face.high)
        if np.abs(step).max(initial=0.0) < NEWTON_TOLERANCE * size:
            break
    s, su, sv = face.jet(uv)
    distance = np.hypot(_dot(a, s - points), _dot(b, s - points))
    normals = np.cross(su, sv)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals *= np.sign(normals[:, 2:])
    if not np.isfinite(s).all():
        raise NumericalError("the independent trace met a degenerate face")
    near = MEETS * face.width
    met = (distance < near) & (_dot(s - points, directions) >= -near) & (_dot(normals, directions) > 0)
    return s, normals, met


def _refract(
    directions: NDArray[np.float64], normals: NDArray[np.float64], eta: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (directions, transmittance) by the vector form of Snell's law; T = 0 where totally reflected."""
    cos_i = _dot(directions, normals)
    square = 1 - eta**2 * (1 - cos_i**2)
    passes = (square > 0) & (cos_i > 0)
    cos_t = np.sqrt(np.where(passes, square, 1.0))
    refracted = eta * directions + (cos_t - eta * cos_i)[:, None] * normals
    rs = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    rp = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    return refracted, np.where(passes, 1 - (rs**2 + rp**2) / 2, 0.0)


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.einsum("ij,ij->i", a, b)
