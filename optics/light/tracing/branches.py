"""Branches of light at the faces of the closed lens: what they meet next, and how they split there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import DeviceRays, Vector
from optics.light.tracing.body_faces import body_faces
from optics.light.tracing.lens_faces import lens_faces
from optics.light.tracing.refraction import refract
from optics.scene.paths import BARE, Coats
from optics.scene.sources import Rays
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.moulds import Solid, rounded_off

# what a branch in air met last: nothing, a face that it did not pass, the face it left by
NEVER, OUTSIDE, FRONT, REAR, EDGE = range(5)
UNDECIDED = 5  # what a branch meets next, where no face is proven to be the first
SOURCE, ENTERED, LEFT, INDIRECT = range(4)  # stages of the direct path: front refracts, rear refracts


@dataclass(eq=False)
class Branches:
    """Branches of one generation, arrays of equal length (vectors: (3, m)).

    left : what the branch met last while in air.  stage : on the direct path.
    """

    origin: Floats
    direction: Floats
    flux: Floats
    ray: NDArray[np.int64]
    inside: NDArray[np.bool_]
    left: NDArray[np.int8]
    stage: NDArray[np.int8]

    @classmethod
    def start(cls, rays: Rays) -> Branches:
        n = len(rays.flux)
        none = np.zeros(n, dtype=np.int8)
        return cls(
            origin=rays.origin,
            direction=rays.direction,
            flux=rays.flux,
            ray=np.arange(n),
            inside=none > 0,
            left=none + NEVER,
            stage=none + SOURCE,
        )

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Branches:
        return Branches(*(getattr(self, f.name)[..., chosen] for f in fields(self)))

    def __add__(self, other: Branches) -> Branches:
        return Branches(
            *(np.concatenate([getattr(b, f.name) for b in (self, other)], axis=-1) for f in fields(self))
        )

    def survivors(self, least: Floats, roulette: np.random.Generator) -> Branches:
        """Return the branches that Russian roulette leaves, none with less flux than `least`, (m,) W.

        A branch of flux F < least survives with the probability F / least and then carries `least`.
        """
        lives = roulette.random(len(least)) * least < self.flux
        return replace(self, flux=np.maximum(self.flux, least))[lives]


@dataclass(frozen=True, eq=False)
class Meetings:
    """What branches meet next, (m,) or (3, m).

    face : FRONT, REAR, EDGE, NEVER where they leave, or UNDECIDED.  absorbed : (m,), at a rounded edge.
    """

    face: NDArray[np.int8]
    point: Floats
    refracted: Floats
    reflected: Floats
    transmittance: Floats
    absorbed: NDArray[np.bool_]

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Meetings:
        return Meetings(*(getattr(self, f.name)[..., chosen] for f in fields(self)))


class ClosedLens:
    """The faces of a lens or its body, and what happens to branches there.

    coats : what coatings of front and rear let through of light that is not reflected totally.
    Rounded edges absorb light, with all that lies between them and the sharp edge in their place.
    """

    @property
    def absorbs(self) -> bool:
        """Whether some of it absorbs light."""
        return self._rounded is not None

    def __init__(self, backend: Backend, solid: Solid, coats: Coats = BARE) -> None:
        if backend.dtype != np.float64:
            raise ValueError("non-sequential tracing needs a backend in double precision")
        self._backend = backend
        self._faces = lens_faces(backend, solid) if isinstance(solid, Lens) else body_faces(backend, solid)
        self._rounded = None if isinstance(solid, Lens) or not solid.rounded else solid
        self._coats = coats
        self._index = backend.dr.opaque(backend.Float, solid.index)

    def meet(self, branches: Branches) -> Meetings:
        """Return the first meetings of branches."""
        backend, dr = self._backend, self._backend.dr
        ox, oy, oz = (backend.array(a) for a in branches.origin)
        dx, dy, dz = (backend.array(a) for a in branches.direction)
        rays = DeviceRays((ox, oy, oz), (dx, dy, dz), inside=backend.array(branches.inside) > 0)
        path, nx, ny, nz = (backend.Float(a) for a in (dr.inf, 0, 0, 0))
        face, doubt = backend.Float(NEVER), backend.Float(dr.inf)
        for kind, one in zip((FRONT, REAR, EDGE, EDGE, EDGE, EDGE), self._faces):
            meeting = one.meet(rays)
            first = meeting.path < path
            path = dr.select(first, meeting.path, path)
            face = dr.select(first, float(kind), face)
            nx, ny, nz = (dr.select(first, a, b) for a, b in zip(meeting.normal, (nx, ny, nz)))
            doubt = dr.minimum(doubt, meeting.doubt)
            dr.eval(path, (nx, ny, nz), face, doubt)
        face = dr.select(doubt < path, float(UNDECIDED), face)
        refracted, reflected, transmittance = self._split(rays, (nx, ny, nz))
        for number, share in zip((FRONT, REAR), self._coats):
            if share is not None:
                transmittance = dr.select((face == number) & (transmittance > 0), share, transmittance)
        point = rays.at(path)
        dr.eval(face, point, refracted, reflected, transmittance)
        faces, points = face.numpy().astype(np.int8), _rows(point)
        absorbed = np.zeros(len(faces), dtype=bool)
        if self._rounded is not None:
            met = (faces != NEVER) & (faces != UNDECIDED)
            absorbed[met] = rounded_off(self._rounded, points[:, met], faces[met] - FRONT)
        return Meetings(
            face=faces,
            point=points,
            refracted=_rows(refracted),
            reflected=_rows(reflected),
            transmittance=transmittance.numpy(),
            absorbed=absorbed,
        )

    def _split(self, rays: DeviceRays, outward: Vector) -> tuple[Vector, Vector, DrArray]:
        """Return refracted and reflected unit directions and the transmittance, for outward normals."""
        dr, d = self._backend.dr, rays.direction
        normal = [dr.select(rays.inside, n, -n) for n in outward]
        cosine = dr.minimum(sum(a * b for a, b in zip(d, normal)), 1)
        eta = dr.select(rays.inside, self._index, 1 / self._index)
        sine = dr.sqrt(1 - cosine * cosine)
        (_, _, behind), transmittance, _ = refract(dr, (sine, 0.0, cosine), (0.0, 0.0), eta)
        refracted = self._unit([eta * a + (behind - eta * cosine) * n for a, n in zip(d, normal)])
        return refracted, self._unit([a - 2 * cosine * n for a, n in zip(d, normal)]), transmittance

    def _unit(self, vector: Sequence[DrArray]) -> Vector:
        length = self._backend.dr.sqrt(sum(a * a for a in vector))
        x, y, z = (a / length for a in vector)
        return x, y, z


def _rows(vector: Vector) -> Floats:
    """Return a vector on the device as an array, (3, m)."""
    return np.array([a.numpy() for a in vector])


def split(branches: Branches, meetings: Meetings) -> tuple[Branches, Branches]:
    """Return the refracted and the reflected branches of all meetings."""
    face, inside, stage = meetings.face, branches.inside, branches.stage
    passed = meetings.transmittance * branches.flux
    left = np.where(inside, face, branches.left)
    after = np.where(
        (stage == SOURCE) & (face == FRONT),
        ENTERED,
        np.where((stage == ENTERED) & (face == REAR), LEFT, INDIRECT),
    )
    refracted = Branches(
        origin=meetings.point,
        direction=meetings.refracted,
        flux=passed,
        ray=branches.ray,
        inside=~inside,
        left=left,
        stage=after.astype(np.int8),
    )
    reflected = Branches(
        origin=meetings.point,
        direction=meetings.reflected,
        flux=branches.flux - passed,
        ray=branches.ray,
        inside=inside,
        left=np.where(branches.left == NEVER, OUTSIDE, branches.left),
        stage=np.full_like(stage, INDIRECT),
    )
    return refracted, reflected
