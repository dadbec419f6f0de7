"""Rays through the faces of a STEP file by optiland, an independent program for optical design.

It shares no code with this one or with OCCT.  Its NURBS geometry takes the poles and knots of the file, its
plane and its standard geometry the vertex, the radius and the conic constant.

For splines it starts Newton's method where a ray crosses the plane z = 0 of the face's frame.  A ray that is
far to the side when it meets the face starts elsewhere, and the iteration may be held at the rim.  So every
ray gets a frame near the height at which it first falls through the face.  That height comes from samples of
the face at a few heights along the ray, by optiland too.

Source: optiland 0.6.3, whose intersection follows W. Martin, E. Cohen, R. Fish, P. Shirley, Practical ray
tracing of trimmed NURBS surfaces, J. Graphics Tools 5 (2000).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from optics.base.runtime import Check
from optics.exchange.verification.independent_checks import RAYS
from optics.exchange.verification.rays_behind import RaysBehind, across_to
from optics.exchange.verification.step_file import StepFile
from optics.exchange.verification.trace_comparison import compared
from optics.exchange.verification.traced_faces import FaceRim
from optics.scene.system import System
from thbcad.checks import Bools, Floats, Integers
from thbcad.lens import OpticalForm
from thbcad.sags import PlacedConic
from thbcad.splines import BSplineSurface

if TYPE_CHECKING:  # optiland takes seconds to load
    from optiland.geometries import BaseGeometry, NurbsGeometry, Plane, StandardGeometry
    from optiland.rays import RealRays

    Frames = Iterator[tuple[Integers, BaseGeometry]]  # numbers of rays and the geometry for them

AT_ONCE = 1000  # rays
HEIGHTS = 17  # from the lowest to the highest pole of a face
NEWTON_STEPS, NEWTON_TOLERANCE = 20, 1e-12  # mm; about ten times the rounding at 1 m from the face
MET = 1e-9  # mm, of a meeting from the face
WAVELENGTH = 0.55  # micrometres; the index does not depend on it


def optiland_available() -> bool:
    """Return whether optiland is installed; it is not loaded."""
    return find_spec("optiland") is not None


def optiland_checks(system: System, file: StepFile) -> list[Check]:
    """Return the Checks of a STEP file by optiland's trace of about 500 rays of the problem's source.

    The faces are traced with the poles and knots that OCCT reads in the file.

    Raises ImportError : optiland is not installed.  OSError, ValueError : as `StepFile.solid`.
    """
    tracer = tracer_by_optiland(file, None if system.reflects else system.designed.index)
    difference = compared(system, system.backend, RAYS, tracer)
    return difference.checks(system.traced_within, "optiland's trace of the file")


def tracer_by_optiland(file: StepFile, index: float | None) -> Callable[[RaysBehind], RaysBehind]:
    """Return the trace of rays through the faces that OCCT reads in a file, as `optiland_through`."""
    return partial(optiland_through, file.solid.front, file.solid.rear, index=index, rims=file.rims)


def optiland_through(
    front: OpticalForm, rear: OpticalForm, rays: RaysBehind, index: float | None, rims: Sequence[FaceRim] = ()
) -> RaysBehind:
    """Trace rays through two faces, by optiland.

    Polarisation is carried by optiland's Fresnel amplitudes across the plane of incidence and in it.

    front, rear : as `optical_forms`, mm; splines have x along u and y along v.
    index : None is a mirror, whose front reflects all.
    rims : of both faces, where these may not fill their rectangles.

    Raises ImportError : optiland is not installed.
    """
    points, onward, weight = rays.points.copy(), rays.directions.copy(), rays.flux.copy()
    fields = rays.polarised.copy()
    faces: list[tuple[OpticalForm, tuple[float, float] | None]] = [(front, None)]
    if index is not None:
        faces = [(front, (1.0, index)), (rear, (index, 1.0))]
    with _numpy_backend():
        for k, (surface, indices) in enumerate(faces):
            every = np.flatnonzero(weight > 0)
            for first in range(0, len(every), AT_ONCE):
                lit = every[first : first + AT_ONCE]
                met, along, matrix = _through(surface, points[lit], onward[lit], indices)
                swinging = np.einsum("nij,nkj->nki", matrix, fields[lit])
                transmittance = (np.abs(swinging) ** 2).sum(axis=(1, 2)) / 2
                passes = transmittance > 0
                if rims:
                    passes[passes] = rims[k].holds(met[passes, :2])
                points[lit[passes]], onward[lit[passes]] = met[passes], along[passes]
                strength = np.sqrt(transmittance[passes])[:, None, None]
                fields[lit[passes]] = swinging[passes] / strength
                weight[lit] *= np.where(passes, transmittance, 0.0)
    if index is not None:
        weight *= onward[:, 2] > 0
    return RaysBehind(points, onward, weight, fields)


@contextmanager
def _numpy_backend() -> Iterator[None]:
    """Set optiland to numpy arrays of double precision, and afterwards back to what it was set to.

    In single precision the functions that its compiler numba has stored on disk can end the process.
    """
    from optiland import backend

    before = backend.get_backend()
    backend.set_backend("numpy")
    bits: object = backend.get_precision()  # 32 or 64; optiland's stubs name a text
    backend.set_precision("float64")
    try:
        yield
    finally:
        backend.set_precision("float32" if bits == 32 else "float64")
        backend.set_backend(before)


def _spline_geometry(surface: BSplineSurface, height: float) -> NurbsGeometry:
    """Return optiland's geometry of a face in a frame at z = height; optiland wants knots from 0 to 1."""
    from optiland.coordinate_system import CoordinateSystem
    from optiland.geometries import NurbsGeometry

    poles = np.moveaxis(surface.coefficients, 2, 0) - np.array([0.0, 0.0, height])[:, None, None]
    u, v = ((kv.knots - kv.start) / (kv.stop - kv.start) for kv in (surface.kv_u, surface.kv_v))
    return NurbsGeometry(
        CoordinateSystem(z=height),
        control_points=poles,
        u_degree=surface.kv_u.degree,
        v_degree=surface.kv_v.degree,
        u_knots=u,
        v_knots=v,
        tol=NEWTON_TOLERANCE,
        max_iter=NEWTON_STEPS,
    )


def _conic_geometry(conic: PlacedConic) -> Plane | StandardGeometry:
    """Return optiland's geometry of a plane or a conic in a frame at its vertex."""
    from optiland.coordinate_system import CoordinateSystem
    from optiland.geometries import Plane, StandardGeometry

    frame = CoordinateSystem(z=conic.vertex)
    if conic.kind == "PLANE":
        return Plane(frame)
    return StandardGeometry(frame, conic.conic.radius, conic.conic.constant)


def _through(
    surface: OpticalForm, points: Floats, directions: Floats, indices: tuple[float, float] | None
) -> tuple[Floats, Floats, Floats]:
    """Return (points, directions, matrices of fields) of rays behind a face, or of those that it reflects.

    Rays that do not pass have the matrix 0 and the direction NaN.
    """
    met, onward = np.full_like(points, np.nan), np.full_like(points, np.nan)
    matrices = np.zeros((len(points), 3, 3))
    if isinstance(surface, PlacedConic):
        half = np.array(surface.half_width)
        frames: Frames = iter([(np.arange(len(points)), _conic_geometry(surface))])
        corners = -half, half
    else:
        frames = _frames(surface, points, directions)
        corners = surface.coefficients[0, 0, :2], surface.coefficients[-1, -1, :2]
    for rays, geometry in frames:
        met[rays], meets = _meeting(geometry, corners, points[rays], directions[rays])
        rays = rays[meets]
        if len(rays):
            onward[rays], matrices[rays] = _refracted(geometry, met[rays], directions[rays], indices)
    return met, onward, matrices


def _frames(surface: BSplineSurface, points: Floats, directions: Floats) -> Frames:
    """Yield (numbers of rays, geometry in a frame near the height at which they fall through a spline)."""
    z = surface.coefficients[..., 2]
    heights = np.unique(np.linspace(z.min(), z.max(), HEIGHTS))
    nearest = _nearest(surface, heights, points, directions)
    for k in np.unique(nearest[nearest >= 0]):
        yield np.flatnonzero(nearest == k), _spline_geometry(surface, heights[k])


def _nearest(surface: BSplineSurface, heights: Floats, points: Floats, directions: Floats) -> Integers:
    """Return the index of the first height at which a ray has fallen through a face, (n,), -1 for none."""
    geometry = _spline_geometry(surface, 0.0)
    poles = np.asarray(geometry.P)
    low, high = poles[:2, 0, 0], poles[:2, -1, -1]
    fallen = np.zeros((len(heights), len(points)), dtype=bool)
    rises = directions[:, 2] > 0
    speed = np.where(rises, directions[:, 2], 1.0)
    for k, height in enumerate(heights):
        along = (height - points[:, 2]) / speed
        here = points[:, :2] + along[:, None] * directions[:, :2]
        u, v = np.clip((here - low) / (high - low), 0, 1).T
        fallen[k] = rises & (along >= 0) & (geometry.get_value(u, v)[2] <= height + MET)
    return np.where(fallen.any(axis=0), fallen.argmax(axis=0), -1)


def _meeting(
    geometry: BaseGeometry, corners: tuple[Floats, Floats], points: Floats, directions: Floats
) -> tuple[Floats, Bools]:
    """Return (points, met) where rays meet a face; rays that pass it by end anywhere.

    corners : least and greatest (x, y) of the face
    """
    rays = _rays(geometry, points, directions)
    with np.errstate(all="ignore"):  # optiland gives nan for rays that miss a conic
        along = np.asarray(geometry.distance(rays))
        met = points + along[:, None] * directions
        low, high = corners
        meets = (along >= 0) & (met[:, :2] >= low - MET).all(axis=1) & (met[:, :2] <= high + MET).all(axis=1)
    if meets.any():
        x, y, z = met[meets].T
        meets[meets] = np.abs(geometry.cs.z + geometry.sag(x, y) - z) <= MET
    return met, meets


def _refracted(
    geometry: BaseGeometry, points: Floats, directions: Floats, indices: tuple[float, float] | None
) -> tuple[Floats, Floats]:
    """Return (directions, matrices of fields, (n, 3, 3)) behind a face, 0 where light is totally reflected;
    without indices those of a mirror.

    With s across the plane of incidence, p and q in it across the directions before and behind the face, the
    matrix is c (t_s s s^T + t_p q p^T) with t_s and t_p from optiland, and c^2 = n_2 cos(t) / (n_1 cos(i)).
    """
    from optiland.jones import JonesFresnel
    from optiland.materials import IdealMaterial

    rays = _rays(geometry, points, directions)
    normals = nx, ny, nz = geometry.surface_normal(rays)
    normal = np.column_stack(normals)
    if indices is None:
        rays.reflect(nx, ny, nz)
        s_part, p_part = -np.ones(len(points)), np.ones(len(points))
    else:
        rays.refract(nx, ny, nz, *indices)
    onward = np.column_stack([rays.L, rays.M, rays.N])
    if indices is not None:
        before, after = (np.abs(np.einsum("ij,ij->i", a, normal)) for a in (directions, onward))
        jones = JonesFresnel(*map(IdealMaterial, indices)).calculate_matrix(
            rays, aoi=np.arccos(np.minimum(before, 1.0))
        )
        power = np.sqrt(np.nan_to_num(indices[1] * after / (indices[0] * before)))
        s_part, p_part = (np.real(jones[:, k, k]) * power for k in (0, 1))
    plane = np.cross(directions, normal)
    size = np.linalg.norm(plane, axis=1, keepdims=True)
    s = np.where(size > 0, plane, across_to(directions))
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    across = s_part[:, None, None] * s[:, :, None] * s[:, None, :]
    within = p_part[:, None, None] * np.cross(onward, s)[:, :, None] * np.cross(directions, s)[:, None, :]
    return onward, np.nan_to_num(across + within)


def _rays(geometry: BaseGeometry, points: Floats, directions: Floats) -> RealRays:
    """Return optiland's container of rays, in the frame of a face."""
    from optiland.rays import RealRays

    (x, y, z), (l, m, n) = points.T, directions.T
    rays = RealRays(x, y, z, l, m, n, np.ones(len(points)), np.full(len(points), WAVELENGTH))
    geometry.localize(rays)
    return rays
