"""Branches of light at the faces of the closed lens: what they meet next, and how they split there."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.tracing.device_rays import DeviceRays
from optics.tracing.lens_faces import lens_faces
from optics.tracing.refraction import refract

if TYPE_CHECKING:
    from optics.runtime import Backend
    from optics.sources import Rays
    from thbcad.lens import Lens

# what a branch in air met last: nothing, a face that it did not pass, the face it left by
NEVER, OUTSIDE, FRONT, REAR, EDGE = range(5)
SOURCE, ENTERED, LEFT, INDIRECT = range(4)  # stages of the direct path: front refracts, rear refracts


@dataclass(eq=False)
class Branches:
    """Branches of one generation, arrays of equal length (vectors: (3, m)).

    left : what the branch met last while in air.  stage : on the direct path.
    """

    origin: NDArray[np.float64]
    direction: NDArray[np.float64]
    flux: NDArray[np.float64]
    ray: NDArray[np.int64]
    inside: NDArray[np.bool_]
    left: NDArray[np.int8]
    stage: NDArray[np.int8]

    @classmethod
    def start(cls, rays: Rays) -> Branches:
        n = len(rays.flux)
        none = np.zeros(n, dtype=np.int8)
        return cls(
            rays.origin, rays.direction, rays.flux, np.arange(n), none > 0, none + NEVER, none + SOURCE
        )

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Branches:
        return Branches(*(getattr(self, f.name)[..., chosen] for f in fields(self)))

    def __add__(self, other: Branches) -> Branches:
        return Branches(
            *(np.concatenate([getattr(b, f.name) for b in (self, other)], axis=-1) for f in fields(self))
        )


@dataclass(frozen=True, eq=False)
class Meetings:
    """What branches meet next, (m,) or (3, m): face is FRONT, REAR, EDGE, or NEVER where they leave."""

    face: NDArray[np.int8]
    point: NDArray[np.float64]
    refracted: NDArray[np.float64]
    reflected: NDArray[np.float64]
    transmittance: NDArray[np.float64]


class ClosedLens:
    """The faces of a lens, and what happens to branches there."""

    def __init__(self, backend: Backend, lens: Lens) -> None:
        if backend.dtype != np.float64:
            raise ValueError("non-sequential tracing needs a backend in double precision")
        self._backend = backend
        self._faces = lens_faces(backend, lens)
        self._index = backend.dr.opaque(backend.Float, lens.index)

    def meet(self, branches: Branches) -> Meetings:
        """Return the first meetings of branches."""
        backend, dr = self._backend, self._backend.dr
        origin, direction = (
            tuple(backend.array(a) for a in v) for v in (branches.origin, branches.direction)
        )
        rays = DeviceRays(origin, direction, inside=backend.array(branches.inside) > 0)
        path, normal, face = backend.Float(dr.inf), (backend.Float(0),) * 3, backend.Float(NEVER)
        for kind, one in zip((FRONT, REAR, EDGE, EDGE, EDGE, EDGE), self._faces):
            t, n = one.meet(rays)
            first = t < path
            path, face = dr.select(first, t, path), dr.select(first, float(kind), face)
            normal = tuple(dr.select(first, a, b) for a, b in zip(n, normal))
            dr.eval(path, normal, face)
        results = (face, rays.at(path), *self._split(rays, normal))
        dr.eval(results)
        face, *vectors, transmittance = results
        vectors = [np.array([a.numpy() for a in v]) for v in vectors]
        return Meetings(face.numpy().astype(np.int8), *vectors, transmittance.numpy())

    def _split(self, rays: DeviceRays, normal: tuple) -> tuple:
        """Return refracted and reflected unit directions and the transmittance, for outward normals."""
        dr, d = self._backend.dr, rays.direction
        normal = [dr.select(rays.inside, n, -n) for n in normal]
        cosine = dr.minimum(sum(a * b for a, b in zip(d, normal)), 1)
        eta = dr.select(rays.inside, self._index, 1 / self._index)
        sine = dr.sqrt(1 - cosine * cosine)
        (_, _, behind), transmittance, _ = refract(dr, (sine, 0.0, cosine), (0.0, 0.0), eta)
        refracted = self._unit([eta * a + (behind - eta * cosine) * n for a, n in zip(d, normal)])
        return refracted, self._unit([a - 2 * cosine * n for a, n in zip(d, normal)]), transmittance

    def _unit(self, vector: list) -> list:
        length = self._backend.dr.sqrt(sum(a * a for a in vector))
        return [a / length for a in vector]


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
        meetings.point, meetings.refracted, passed, branches.ray, ~inside, left, after.astype(np.int8)
    )
    left = np.where(branches.left == NEVER, OUTSIDE, branches.left)
    indirect = np.full_like(stage, INDIRECT)
    return refracted, Branches(
        meetings.point, meetings.reflected, branches.flux - passed, branches.ray, inside, left, indirect
    )
