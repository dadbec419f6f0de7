"""Branches of light at the faces of the closed lens: what they meet next, and how they split there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import chain, repeat

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import DeviceRays, Stokes, Vector
from optics.light.tracing.body_faces import Face, body_faces, plate_faces
from optics.light.tracing.fates import FATES
from optics.light.tracing.lens_faces import lens_faces
from optics.light.tracing.refraction import (
    Mueller,
    at_face,
    reflection,
    refract,
    selected,
    transmission,
    uniform,
)
from optics.scene.paths import BARE, Coats
from optics.scene.sources import Rays
from thbcad.checks import Floats
from thbcad.moulds import Made, MouldedBody, Plate, rounded_off

# what a branch in air met last: nothing, a face that it did not pass, the face it left by; fronts and rears
# of a plate's other lenses are those of neighbours
NEVER, OUTSIDE, FRONT, REAR, EDGE, NEIGHBOUR = range(6)
UNDECIDED = 6  # what a branch meets next, where no face is proven to be the first
SOURCE, ENTERED, LEFT, INDIRECT = range(4)  # stages of the direct path: front refracts, rear refracts


@dataclass(eq=False)
class Branches:
    """Branches of one generation, arrays of equal length (vectors: (3, m)).

    left : what the branch met last while in air.  stage : on the direct path.
    stokes : Q / I, U / I, V / I.  across : normal to the branch, of any length, where Q is positive.
    """

    origin: Floats
    direction: Floats
    flux: Floats
    stokes: Floats
    across: Floats
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
            stokes=np.zeros((3, n)),
            across=np.zeros((3, n)),
            ray=np.arange(n),
            inside=none > 0,
            left=none + NEVER,
            stage=none + SOURCE,
        )

    def __getitem__(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Branches:
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

    face : FRONT, REAR, EDGE, NEIGHBOUR, NEVER where they leave, or UNDECIDED.
    transmittance : of the light as it is polarised.  mean : of unpolarised light.
    passing, staying : Stokes parameters of what is refracted and of what is reflected, along `across`.
    absorbed : (m,), at a rounded edge.
    """

    face: NDArray[np.int8]
    point: Floats
    refracted: Floats
    reflected: Floats
    transmittance: Floats
    mean: Floats
    passing: Floats
    staying: Floats
    across: Floats
    absorbed: NDArray[np.bool_]

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Meetings:
        return Meetings(*(getattr(self, f.name)[..., chosen] for f in fields(self)))


class ClosedLens:
    """The faces of a lens, its body or a plate of lenses, and what happens to branches there.

    coats : what coatings of front and rear let through of light that is not reflected totally.
    Rounded edges absorb light, with all that lies between them and the sharp edge in their place.
    """

    @property
    def absorbs(self) -> bool:
        """Whether some of it absorbs light."""
        return self._rounded is not None

    def __init__(self, backend: Backend, solid: Made, coats: Coats = BARE) -> None:
        if backend.dtype != np.float64:
            raise ValueError("non-sequential tracing needs a backend in double precision")
        self._backend = backend
        self._plate = plate_faces(backend, solid) if isinstance(solid, Plate) else []
        self._faces: Sequence[Face] = ()
        if isinstance(solid, MouldedBody):
            self._faces = body_faces(backend, solid)
        elif not isinstance(solid, Plate):
            self._faces = lens_faces(backend, solid)
        self._rounded = solid if isinstance(solid, MouldedBody) and solid.rounded else None
        self._coats = coats
        self._index = backend.opaque(solid.index)

    def meet(self, branches: Branches) -> Meetings:
        """Return the first meetings of branches."""
        backend, dr = self._backend, self._backend.dr
        rays = self._rays(branches)
        if self._plate:
            path, nx, ny, nz, face, doubt = map(backend.array, self._first_of_plate(branches))
        else:
            path, nx, ny, nz, face, doubt = self._first(rays, self._faces)
        face = dr.select(doubt < path, float(UNDECIDED), face)
        x, y, z = (dr.select(rays.inside, n, -n) for n in (nx, ny, nz))
        refracted, reflected, through, back = self._split(rays, (x, y, z), face)
        stokes = self._stokes(branches)
        (transmittance, passing), (_, staying) = (
            at_face(dr, stokes, rays.direction, (x, y, z), matrix) for matrix in (through, back)
        )
        point = rays.at(path)
        dr.eval(face, point, refracted, reflected, transmittance, through.mean, passing, staying)
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
            mean=through.mean.numpy(),
            passing=_rows((passing.q, passing.u, passing.v)),
            staying=_rows((staying.q, staying.u, staying.v)),
            across=_rows(passing.across),
            absorbed=absorbed,
        )

    def _rays(self, branches: Branches, shift: Floats | None = None) -> DeviceRays:
        """Return branches on the device, in a frame that lies elsewhere."""
        backend = self._backend
        origin = branches.origin if shift is None else branches.origin - shift[:, None]
        ox, oy, oz = (backend.array(a) for a in origin)
        dx, dy, dz = (backend.array(a) for a in branches.direction)
        return DeviceRays((ox, oy, oz), (dx, dy, dz), inside=backend.array(branches.inside) > 0)

    def _first(self, rays: DeviceRays, faces: Iterable[Face]) -> tuple[DrArray, ...]:
        """Return the path to what rays meet first of front, rear and edges, the normal there, which of them
        it is, and from where on that is in doubt.

        A face is looked at along the rays that may meet it before the faces that were looked at already.
        """
        backend, dr = self._backend, self._backend.dr
        n = dr.width(rays.origin)
        path, nx, ny, nz = (dr.full(backend.Float, a, n) for a in (dr.inf, 0, 0, 0))
        face, doubt = dr.full(backend.Float, NEVER, n), dr.full(backend.Float, dr.inf, n)
        for kind, one in zip(chain((FRONT, REAR), repeat(EDGE)), faces):
            chosen = dr.compress(one.reach(rays) < path)
            if not len(chosen):
                continue
            meeting = one.meet(_gathered(backend, rays, chosen))
            first = meeting.path < dr.gather(backend.Float, path, chosen)
            values = (meeting.path, *meeting.normal, float(kind))
            for row, value in zip((path, nx, ny, nz, face), values):
                dr.scatter(row, backend.Float(value), chosen, first)
            doubtful = dr.minimum(dr.gather(backend.Float, doubt, chosen), meeting.doubt)
            dr.scatter(doubt, doubtful, chosen)
            dr.eval(path, nx, ny, nz, face, doubt)
        return path, nx, ny, nz, face, doubt

    def _first_of_plate(self, branches: Branches) -> Floats:
        """Return what `_first` does of a plate, (6, m)."""
        found = np.zeros((6, branches.flux.size))
        found[[0, 5]] = np.inf
        found[4] = NEVER
        for number, part in enumerate(self._plate):
            reached = np.flatnonzero(part.reached(branches.origin, branches.direction))
            if not reached.size:
                continue
            first = self._first(self._rays(branches[reached], part.shift), part.faces)
            rows = np.array([row.numpy() for row in first])
            optical = (rows[4] == FRONT) | (rows[4] == REAR)
            if part is self._plate[-1]:
                rows[4, optical] = EDGE  # of the land
            elif number:
                rows[4, optical] = NEIGHBOUR
            nearer = rows[0] < found[0, reached]
            found[:5, reached[nearer]] = rows[:5, nearer]
            found[5, reached] = np.minimum(found[5, reached], rows[5])
        return found

    def _split(
        self, rays: DeviceRays, normal: Vector, face: DrArray
    ) -> tuple[Vector, Vector, Mueller, Mueller]:
        """Return refracted and reflected unit directions, and the matrices of refraction and reflection.

        normal : on the side to which light comes through.  face : as of `Meetings`.
        """
        dr, d = self._backend.dr, rays.direction
        cosine = dr.minimum(sum(a * b for a, b in zip(d, normal)), 1)
        eta = dr.select(rays.inside, self._index, 1 / self._index)
        sine = dr.sqrt(1 - cosine * cosine)
        (_, _, behind), _, passes = refract(dr, (sine, 0.0, cosine), (0.0, 0.0), eta)
        refracted = self._unit([eta * a + (behind - eta * cosine) * n for a, n in zip(d, normal)])
        reflected = self._unit([a - 2 * cosine * n for a, n in zip(d, normal)])
        through, back = transmission(dr, cosine, eta), reflection(dr, cosine, eta)
        for number, share in zip((FRONT, REAR), self._coats):
            if share is not None:
                coated = passes & (face == number)
                through = selected(dr, coated, uniform(share, False), through)
                back = selected(dr, coated, uniform(1 - share, True), back)
        return refracted, reflected, through, back

    def _stokes(self, branches: Branches) -> Stokes:
        """Return the polarisation of branches on the device."""
        q, u, v = map(self._backend.array, branches.stokes)
        x, y, z = map(self._backend.array, branches.across)
        return Stokes(q, u, v, (x, y, z))

    def _unit(self, vector: Sequence[DrArray]) -> Vector:
        length = self._backend.dr.sqrt(sum(a * a for a in vector))
        x, y, z = (a / length for a in vector)
        return x, y, z


def _gathered(backend: Backend, rays: DeviceRays, chosen: DrArray) -> DeviceRays:
    """Return the rays of these numbers, without their flux."""
    dr = backend.dr
    (ox, oy, oz), (dx, dy, dz) = (
        [dr.gather(backend.Float, a, chosen) for a in vector] for vector in (rays.origin, rays.direction)
    )
    inside = dr.gather(backend.Float, dr.select(rays.inside, backend.Float(1), 0), chosen) > 0
    return DeviceRays((ox, oy, oz), (dx, dy, dz), inside=inside)


def _rows(vector: Vector) -> Floats:
    """Return a vector on the device as an array, (3, m)."""
    return np.array([a.numpy() for a in vector])


class BranchAccount:
    """What becomes of the flux of every source ray, (fates, n), W."""

    def __init__(self, rays: int, absorption: float) -> None:
        self.by_ray, self._absorption = np.zeros((len(FATES), rays)), absorption

    def add(self, branches: Branches, fate: NDArray[np.int64] | int) -> None:
        np.add.at(self.by_ray, (np.broadcast_to(fate, branches.ray.shape), branches.ray), branches.flux)

    def dimmed(self, branches: Branches, path: Floats) -> Branches:
        """Return branches behind paths, mm, and account for what glass absorbs there."""
        if not self._absorption:
            return branches
        kept = np.where(branches.inside, np.exp(-self._absorption * path), 1.0)
        self.add(replace(branches, flux=branches.flux * (1 - kept)), FATES.index("absorbed"))
        return replace(branches, flux=branches.flux * kept)


def indirectly_onto_rear(branches: Branches, meetings: Meetings) -> Branches:
    """Return the branches within, by no direct path, that meet a rear which lets some of them through.

    Their flux is that of unpolarised light of which the rear lets as much through.
    """
    within = branches.inside & (branches.stage == INDIRECT)
    met = within & (meetings.face == REAR) & (meetings.transmittance > 0)
    light, passing = branches[met], meetings[met]
    return replace(light, flux=light.flux * passing.transmittance / passing.mean)


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
        stokes=meetings.passing,
        across=meetings.across,
        ray=branches.ray,
        inside=~inside,
        left=left,
        stage=after.astype(np.int8),
    )
    reflected = Branches(
        origin=meetings.point,
        direction=meetings.reflected,
        flux=branches.flux - passed,
        stokes=meetings.staying,
        across=meetings.across,
        ray=branches.ray,
        inside=inside,
        left=np.where(branches.left == NEVER, OUTSIDE, branches.left),
        stage=np.full_like(stage, INDIRECT),
    )
    return refracted, reflected
