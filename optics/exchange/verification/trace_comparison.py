"""The same rays by the optimiser's tracer and by another: differences of landings, fates and irradiance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from optics.base.runtime import Backend, Check
from optics.exchange.verification.rays_behind import RaysBehind
from optics.exchange.verification.reference_tracer import OpticalFaces, fixed_face, lens_faces, through_faces
from optics.exchange.verification.step_file import StepFile
from optics.exchange.verification.traced_faces import FaceRim
from optics.light.tracing import LandingPoints, Tracer
from optics.scene.paths import LightPath
from optics.scene.problem import Verify
from optics.scene.receivers import Screen
from optics.scene.sources import RayGrid, Rays
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.lens import Lens

NO_LIGHT = 1e-12  # of a ray's mean flux: rays with less count nowhere, and threads may round it to none


@dataclass(frozen=True)
class Comparison:
    """How far two traces are apart.

    landing : mm, degrees in the far field; the greatest error of a coordinate on the target, inf where no ray
        lands there.
    irradiance : relative L2 difference on the target's pixels.
    mismatched : number of rays that arrive in one of them only, with more than 1e-12 of a ray's mean flux.
    unit : of landing.
    """

    landing: float
    irradiance: float
    mismatched: int
    unit: str

    def checks(self, limits: Verify, by: str) -> list[Check]:
        """Return the Checks of fates, landing points and irradiance.  by : the other trace, in words."""
        return [
            Check.none_of(f"rays with another fate by {by}", self.mismatched),
            Check(f"landing points by {by}", self.landing, limits.landing, self.unit),
            Check(f"irradiance by {by}, relative", self.irradiance, limits.irradiance, ""),
        ]


def compared(
    system: System,
    backend: Backend,
    counts: Sequence[int],
    other: Callable[[RaysBehind], RaysBehind],
    blocked: bool = False,
) -> Comparison:
    """Return the Comparison of rays traced through the lens in memory and by `other`.

    Fixed elements before and behind the lens are traced by scipy, with their prescriptions.  Of a body for a
    mould only rays count that its walls and rounded edges surely leave.

    backend : of double precision.  counts : of rays of the system's source, as in `LightSource.rays`.
    other : takes rays through the lens, in its frame.
    blocked : whether it knows of stops, clear aperture and coatings; else both traces leave them out.
    """
    rays, path = system.source.rays(counts), _clear(system)
    path = path if blocked else path.without_stops().without_coats()
    return _difference(system, backend, rays, path, _by_others(system, path, rays, other))


def file_landing(system: System, step: OpticalFaces, file: StepFile) -> LandingPoints:
    """Return where rays land that scipy traces through the front and the rear of a STEP file.

    Their number is that of `verify.rays`.  Stops, clear aperture and coatings take what they do.

    step : the faces as read back.  file : whose text bounds those of a lens with an outline.
    """
    path, made = system.own_path, system.solid
    rims: Sequence[FaceRim] = ()
    if not isinstance(made, Lens):
        path = system.held(path, made.free)
    elif not system.designed.rear.outline.is_rectangle:
        rims = file.rims
    faces = lens_faces(step, path, system.own_faces, rims)
    by_scipy = partial(through_faces, faces, stops=path.stops)
    return _by_others(system, _clear(system), _checked_rays(system), by_scipy)


def light_checks(system: System, landing: LandingPoints, backend: Backend) -> list[Check]:
    """Return the Checks of the light through the front and the rear of a STEP file, as read back from it.

    landing : see `file_landing`.  backend : of double precision.
    """
    limits = system.traced_within
    seen = _difference(system, backend, _checked_rays(system), _clear(system), landing)
    return [
        Check.none_of("rays with another fate in the independent trace", seen.mismatched),
        Check("landing points, independent trace of the file", seen.landing, limits.landing, seen.unit),
        Check("irradiance, independent trace of the file, relative", seen.irradiance, limits.irradiance, ""),
    ]


def _checked_rays(system: System) -> Rays | RayGrid:
    return system.source.rays([system.traced_within.rays] * 2)


def _clear(system: System) -> LightPath:
    """Return the path without absorption, which the independent tracers leave out."""
    return system.path.without_absorption()


def exact_landing(path: LightPath, rays: RayGrid | Rays, backend: Backend) -> LandingPoints:
    """Return where rays along a path land.  backend : of double precision."""
    landing = Tracer(backend, path, rays).landed()
    backend.dr.eval(landing.x, landing.y, landing.flux)
    flux = landing.flux.numpy()
    points = np.column_stack([landing.x.numpy(), landing.y.numpy()])
    return LandingPoints(np.where(flux[:, None] > 0, points, np.nan), flux)


def _difference(
    system: System, backend: Backend, rays: Rays | RayGrid, path: LightPath, others: LandingPoints
) -> Comparison:
    """Return the Comparison of rays along a path with where others say that they land."""
    ours = exact_landing(path, rays, backend)
    points, flux = ours.points, ours.flux
    screen, made = system.target.screen(), system.solid
    if not isinstance(made, Lens):
        within = exact_landing(system.held(path, made.free), rays, backend)
        kept = (flux == 0) | (within.flux > 0)
        flux, others = flux * kept, LandingPoints(others.points, others.flux * kept)
    # beside the target lands light that leaves at grazing angles: the last digit of a slope moves it by far
    least = NO_LIGHT * rays.flux.mean()
    lit, others_lit = flux > least, others.flux > least
    both = lit & others_lit & (np.abs(points) <= screen.half_width).all(axis=1)
    error = float(np.abs(points[both] - others.points[both]).max()) if both.any() else np.inf
    image, other_image = deposit(points, flux, screen), deposit(others.points, others.flux, screen)
    norm = np.linalg.norm(image)
    return Comparison(
        landing=error,
        irradiance=float(np.linalg.norm(image - other_image) / norm) if norm else np.inf,
        mismatched=int((lit != others_lit).sum()),
        unit=screen.unit,
    )


def _by_others(
    system: System, path: LightPath, rays: Rays | RayGrid, other: Callable[[RaysBehind], RaysBehind]
) -> LandingPoints:
    """Return where rays land that others trace."""
    single, own = rays.rays(path.before), [*system.own_faces]
    every = range(len(path.surfaces))
    before, behind = ([fixed_face(path, k) for k in part] for part in (every[: own[0]], every[own[-1] + 1 :]))
    along = RaysBehind(single.origin.T, single.direction.T, np.asarray(single.flux, dtype=float))
    met = other(through_faces(before, along, path.stops).posed(system.pose.inverse()))
    return through_faces(behind, met.posed(system.pose), path.stops).landing(path.receiver, path.stops)


def deposit(points: Floats, flux: Floats, screen: Screen) -> Floats:
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
