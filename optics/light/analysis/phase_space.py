"""Light in phase space: the points (x, y, p, q) at which rays cross a plane, and what optics conserves there.

p = n sin(theta) cos(phi) and q = n sin(theta) sin(phi) are optical direction cosines.  An element of
etendue is dU = dx dy dp dq (thesis 2.30), the flux per etendue is the basic radiance L / n^2 (2.31).
Without losses both are conserved along every ray (2.25): the map from the source plane to the
target plane has the Jacobian determinant 1, and light of one radiance keeps it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.base.runtime import Backend
from optics.light.tracing import Tracer
from optics.scene.paths import LightPath
from optics.scene.receivers import receiver_at
from optics.scene.sources import Rays
from thbcad.checks import Floats
from thbcad.lens import Lens

STEP = 1e-5  # of the extent in every coordinate: central differences


@dataclass(frozen=True, eq=False)
class PhaseSpace:
    """Rays as they cross a plane: points (4, n) of x, y in mm and p, q; flux (n,) in W, zero for rays that do
    not."""

    points: Floats
    flux: Floats

    def radiance(self, bins: tuple[int, int, int, int], extent: tuple[float, float, float, float]) -> Floats:
        """Return the basic radiance on a grid of bins, W / mm^2 (per unit of p and q): a phase-space
        detector.

        extent : half-widths in x, y, p, q of the box |.| <= extent that the bins tile.
        """
        ranges = [(-e, e) for e in extent]
        flux, _ = np.histogramdd(self.points.T, bins=bins, range=ranges, weights=self.flux)
        return flux / np.prod([2 * e / n for e, n in zip(extent, bins)])


def source_points(rays: Rays) -> Floats:
    """Return the points (x, y, p, q) of rays that start in air on a plane across z, (4, n)."""
    return np.concatenate([rays.origin[:2], rays.direction[:2]])


def at_target(
    backend: Backend, lens: Lens, points: Floats, source_z: float, target_z: float, flux: float | Floats = 1.0
) -> PhaseSpace:
    """Trace rays through a lens, in sequence, and return them in the plane z = target_z.

    points : (4, n) in the plane z = source_z.  flux : W of each ray.
    """
    x, y, p, q = points
    origin, direction = np.stack([x, y, np.full_like(x, source_z)]), [p, q, np.sqrt(1 - p * p - q * q)]
    rays = Rays(origin, np.stack(direction), np.broadcast_to(np.asarray(flux, dtype=np.float64), x.shape))
    landing = Tracer(backend, LightPath.through(lens, receiver_at(target_z), 0.0), rays).landed()
    found = [landing.x, landing.y, landing.p, landing.q, landing.flux]
    backend.dr.eval(found)
    *coordinates, arriving = (a.numpy() for a in found)
    return PhaseSpace(np.stack(coordinates), arriving)


def jacobian_determinants(
    backend: Backend,
    lens: Lens,
    points: Floats,
    extent: tuple[float, float, float, float],
    source_z: float,
    target_z: float,
) -> Floats:
    """Return the determinants of d(x, y, p, q)_target / d(x, y, p, q)_source at points (4, n), by central
    differences.

    Conservation of etendue makes them 1 (Liouville).  NaN where the ray or a neighbour does not arrive.

    extent : size of the source in x, y, p, q; a difference step is 1e-5 of it.
    """
    count, steps = points.shape[1], STEP * np.asarray(extent)
    moved = np.concatenate(
        [points + sign * step[:, None] for step in np.diag(steps) for sign in (1, -1)], axis=1
    )
    there = at_target(backend, lens, moved, source_z, target_z)
    images = there.points.reshape(4, 4, 2, count)  # coordinate, moved along, sign, ray
    jacobian = (images[:, :, 0] - images[:, :, 1]) / (2 * steps[None, :, None])
    arrive = (there.flux.reshape(4, 2, count) > 0).all(axis=(0, 1))
    found = np.full(count, np.nan)
    found[arrive] = np.linalg.det(np.moveaxis(jacobian, -1, 0)[arrive])
    return found
