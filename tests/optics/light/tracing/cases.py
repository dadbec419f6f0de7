"""The independent trace of a lens's STEP file."""

from optics.exchange.verification import trace_step
from optics.scene.receivers import receiver_at
from tests.optics.cases import TARGET_Z
from thbcad import read_step, write_step

INDEX = 1.5


def step_trace(lens, rays, folder, target_z=TARGET_Z):
    """Return the ReferenceRays of the independent trace of the lens's STEP file."""
    write_step(lens, folder / "lens.step")
    step = read_step(folder / "lens.step")
    return trace_step(step, rays.origin.T, rays.direction.T, rays.flux, lens.index, receiver_at(target_z))
