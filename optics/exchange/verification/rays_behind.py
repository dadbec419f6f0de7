"""Rays behind the faces of a file, as independent tracers leave them: stops take some, others land."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from optics.exchange.verification.traced_faces import dot
from optics.light.tracing import LandingPoints
from optics.scene.paths import Stop
from optics.scene.receivers import Cylinder, Receiver, Sphere
from thbcad.checks import Bools, Floats
from thbcad.outlines import Outline
from thbcad.poses import Pose

Fields: TypeAlias = "Floats | NDArray[np.complex128]"


@dataclass(frozen=True, eq=False)
class RaysBehind:
    """Rays behind faces.

    points, directions : (n, 3), mm and unit vectors.  flux : (n,) W, 0 of rays that did not come through.
    fields : (n, 2, 3), electric fields of two parts of the light that do not interfere, with a mean square of
        1 together, complex behind total reflection; None is unpolarised light.
    """

    points: Floats
    directions: Floats
    flux: Floats
    fields: Fields | None = None

    @property
    def polarised(self) -> Fields:
        """Its fields; those of unpolarised light swing across each other."""
        if self.fields is not None:
            return self.fields
        first = across_to(self.directions)
        return np.stack([first, np.cross(self.directions, first)], axis=1)

    def posed(self, pose: Pose) -> RaysBehind:
        """Return them in a frame in which their own has a pose."""
        points, directions = pose.points(self.points.T).T, pose.directions(self.directions.T).T
        fields = None if self.fields is None else self.fields @ pose.rotation.T
        return RaysBehind(points, directions, self.flux, fields)

    def landing(self, target: Receiver, stops: Sequence[Stop] = ()) -> LandingPoints:
        """Return where they land, and the flux that arrives.

        Far-field points are the angles atan(d_x / d_z), atan(d_y / d_z) in degrees.
        """
        landing, meets, length = last_step(self.points, self.directions, target)
        arrives = (self.flux > 0) & meets & passes(stops, self.points, self.directions, length)
        return LandingPoints(np.where(arrives[:, None], landing, np.nan), np.where(arrives, self.flux, 0.0))


def across_to(directions: Floats) -> Floats:
    """Return unit vectors across directions, (n, 3)."""
    across = np.cross(directions, np.eye(3)[np.abs(directions).argmin(axis=1)])
    return across / np.linalg.norm(across, axis=1, keepdims=True)


def last_step(points: Floats, directions: Floats, target: Receiver) -> tuple[Floats, Bools, Floats]:
    """Return where rays land, (n, 2), mm or degrees, whether they meet the target from before it, (n,), and
    how far they go, (n,) mm; inf where they do not, and to the far field.

    points, directions : (n, 3), in the frame of the lens.
    """
    own, along = (points - target.pose.shift) @ target.pose.rotation, directions @ target.pose.rotation
    meets = along[:, 2] > 0
    if isinstance(target, Cylinder):
        landing, length, round_it = _round(own, along, target.radius, isinstance(target, Sphere))
        meets &= round_it
        return landing, meets, np.where(meets, length, np.inf)
    across = along[:, :2] / np.where(meets, along[:, 2], 1.0)[:, None]
    if target.far_field:
        return np.degrees(np.arctan(across)), meets, np.full(len(points), np.inf)
    length = np.where(meets, -own[:, 2] / np.where(meets, along[:, 2], 1.0), np.inf)
    return own[:, :2] - own[:, 2:] * across, meets, length


def _round(points: Floats, directions: Floats, radius: float, sphere: bool) -> tuple[Floats, Floats, Bools]:
    """Return (arcs, lengths, met) of rays on the half of a cylinder or a sphere about (0, 0, radius).

    From its centre it is |p + t d| = |R| without y round a cylinder: the nearer root where R > 0.
    """
    centred = points - (0.0, 0.0, radius)
    some = [0, 1, 2] if sphere else [0, 2]
    p, d = centred[:, some], directions[:, some]
    a, b, c = dot(d, d), dot(p, d), dot(p, p) - radius**2
    met = b * b > a * c
    length = (-b - np.sign(radius) * np.sqrt(np.where(met, b * b - a * c, 1.0))) / a
    x, y, z = (centred + length[:, None] * directions).T / radius
    up = radius * np.arcsin(np.clip(y, -1, 1)) if sphere else radius * y
    return np.column_stack([radius * np.arctan2(x, -z), up]), length, met & (z < 0)


def passes(stops: Sequence[Stop], points: Floats, directions: Floats, length: Floats) -> Bools:
    """Return which rays no stop takes within a length, (n,) mm."""
    free = np.ones(len(points), dtype=bool)
    for stop in stops:
        normal = stop.pose.rotation[:, 2]
        across = directions @ normal
        crosses = across != 0
        path = (stop.pose.shift - points) @ normal / np.where(crosses, across, 1.0)
        there = (points + path[:, None] * directions - stop.pose.shift) @ stop.pose.rotation
        shape = inside(stop.outline, there[:, 0], there[:, 1])
        if stop.inner is not None:
            shape &= ~inside(stop.inner, there[:, 0], there[:, 1])
        free &= ~((shape != stop.hole) & crosses & (path > 0) & (path < length))
    return free


def inside(outline: Outline, x: Floats, y: Floats) -> Bools:
    """Return which points lie within an outline: beyond the middles of its corners within their ellipses."""
    within = (np.abs(x) <= outline.half_width[0]) & (np.abs(y) <= outline.half_width[1])
    if min(outline.corners) > 0:
        beyond = [
            np.maximum(np.abs(a) - (h - c), 0.0) / c
            for a, h, c in zip((x, y), outline.half_width, outline.corners)
        ]
        within &= beyond[0] ** 2 + beyond[1] ** 2 <= 1
    return within
