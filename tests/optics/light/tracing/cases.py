"""Rays of a glowing square, a dome, and the independent trace of a lens's STEP file."""

import numpy as np

from optics.exchange.verification import trace_step
from optics.light.tracing import TargetArea
from optics.scene.receivers import receiver_at
from optics.scene.sources import Rays
from tests.optics.cases import TARGET_Z
from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface, read_step, write_step

INDEX = 1.5
FAR_Z = 1005.0
FAR = TargetArea(receiver_at(FAR_Z), (2000.0, 2000.0))


def lambertian(n, seed=0, half_width=0.5, z=-2.0):
    """Return n rays of a square Lambertian source of 1 W that faces +z."""
    rng = np.random.default_rng(seed)
    sine, phi = np.sqrt(rng.random(n)), rng.uniform(0, 2 * np.pi, n)
    direction = np.array([sine * np.cos(phi), sine * np.sin(phi), np.sqrt(1 - sine**2)])
    origin = np.vstack([rng.uniform(-half_width, half_width, (2, n)), np.full(n, z)])
    return Rays(origin, direction / np.linalg.norm(direction, axis=0), np.full(n, 1 / n))


def step_trace(lens, rays, folder, target_z=TARGET_Z):
    """Return the ReferenceRays of the independent trace of the lens's STEP file."""
    write_step(lens, folder / "lens.step")
    step = read_step(folder / "lens.step")
    return trace_step(step, rays.origin.T, rays.direction.T, rays.flux, lens.index, receiver_at(target_z))


def dome_lens(seed=None, amplitude=1.5):
    """Return the lens of thesis table 6.3, with a random THB sag on the rear if a seed is given."""
    rear = FreeformSurface((8.0, 8.0), Conic(-10.0, -1.0))
    if seed is not None:
        kv = KnotVector.uniform(3, 4, -8.0, 8.0)
        space = THBSpace(kv, kv).refine({0: [(i, j) for i in range(3) for j in range(2, 4)]})
        rear = rear.with_sag(
            THBSurface(space, amplitude * np.random.default_rng(seed).uniform(-1, 1, space.dim))
        )
    return Lens(FreeformSurface((5.0, 5.0), Conic(-5.0, -1.0)), rear, 5.0, INDEX)
