"""Design a lens inside Mitsuba: ten steps of Adam on the THB coefficients, through the exact tracer as an
integrator.

A round beam of 95 mm is to light a disk.  Every render traces the spline surface itself, and `dr.backward`
brings the loss's derivatives down to the coefficients.  Needs `pip install "thbcad[mitsuba]"`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from optics.exchange.mitsuba import exact_integrator, load_mitsuba
from optics.scene.problem import load_problem
from optics.scene.system import System

PIXELS, RAYS_PER_PIXEL, STEPS = 64, 9, 10
RATE = 0.1  # mm per step
TRANSMITTED = 0.92  # W of 1 W: two faces reflect 4 % each
KEY = "integrator.rear_coefficients"


def main() -> list[float]:
    """Print and return the loss of every step, ||E - T||^2 / ||T||^2."""
    mi = load_mitsuba()
    import drjit as dr

    problem = load_problem(Path(__file__).with_name("tophat_circle.toml"))
    system = System(replace(problem, target=replace(problem.target, pixels=(PIXELS, PIXELS))))
    film = {"type": "hdrfilm", "width": PIXELS, "height": PIXELS, "pixel_format": "luminance"}
    sensor = {"type": "perspective", "film": film}  # only its size counts
    integrator = exact_integrator(system)
    scene = mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor})
    parameters = mi.traverse(scene)
    wanted = system.target.irradiance(system.target.screen(), TRANSMITTED)
    target = mi.TensorXf(wanted[..., None])

    optimizer = mi.ad.Adam(lr=RATE)
    optimizer[KEY] = parameters[KEY]
    losses = []
    for step in range(STEPS):
        parameters.update(optimizer)
        image = mi.render(scene, parameters, spp=RAYS_PER_PIXEL)
        loss = dr.sum(dr.square(image - target), axis=None) / dr.sum(dr.square(target), axis=None)
        dr.backward(loss)
        optimizer.step()
        losses.append(float(loss.array[0]))
        print(f"step {step}: loss {losses[-1]:.4f}")
    return losses


if __name__ == "__main__":
    main()
