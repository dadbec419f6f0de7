"""Small systems for the tests of tolerances, and a ray through a perturbed lens by numpy alone."""

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from optics.tolerancing.perturbations import PerturbedLight, tolerances_of
from tests.optics.cases import rough, small_system
from thbcad.surfaces import THBSurface


class Waves:
    """dh = a sin(k x + 1) cos(k y): an error of height."""

    def __init__(self, amplitude=1e-3, rate=0.7):
        self.amplitude, self.rate = amplitude, rate

    def jet(self, x, y):
        a, k = self.amplitude, self.rate
        return np.stack(
            [
                a * np.sin(k * x + 1) * np.cos(k * y),
                a * k * np.cos(k * x + 1) * np.cos(k * y),
                -a * k * np.sin(k * x + 1) * np.sin(k * y),
            ]
        )


class Bowl:
    """dh = c (x^2 + y^2) / 2."""

    def __init__(self, curvature):
        self.curvature = curvature

    def jet(self, x, y):
        return self.curvature * np.stack([(x**2 + y**2) / 2, x, y])


def rough_system(folder, changes=None, height=0.02):
    """Return (system, lens) of the small problem with a rough rear."""
    system = small_system(folder, changes)
    sags = [THBSurface(s.space, rough(s.space, height)) for s in system.base.sags]
    return system.with_sags(sags)


def small_light(folder, backend, changes=None, height=0.02, per_pixel=None):
    """Return the PerturbedLight of the small problem with a rough rear."""
    return PerturbedLight(rough_system(folder, changes, height), backend, per_pixel)


def from_source(p, origin, direction, source_z):
    """Return start and direction of a ray of a source that is moved, its middle at (0, 0, source_z)."""
    turn, pivot = Rotation.from_rotvec(p.source_tilt), np.array([0, 0, source_z])
    return turn.apply(origin - pivot) + pivot + p.source_shift, turn.apply(direction)


def shaped(surface, error=None, power=1.0):
    """Return the function of x and y that tells z and slopes; power : of a bent paraboloid, in proportion."""

    def jet(x, y):
        x, y = (np.clip(a, -h, h) for a, h in zip((x, y), surface.half_width))
        own = np.array([surface(x, y, d) for d in ((0, 0), (1, 0), (0, 1))]) * power
        return own if error is None else own + error.jet(np.array([x]), np.array([y]))[:, 0]

    return jet


def through(start, ray, frames, jet, eta):
    """Return start and direction of a ray behind a surface, which it meets by bisection.

    frames : rotations and shifts of one frame within another, outermost first.  eta : of the indices before
    and behind; 0 mirrors.
    """
    for turn, shift in frames:
        start, ray = turn.apply(start - shift, inverse=True), turn.apply(ray, inverse=True)

    def above(t):
        x, y, z = start + t * ray
        return z - jet(x, y)[0]

    guess = -start[2] / ray[2]
    met = start + brentq(above, guess - 3, guess + 4, xtol=1e-14, rtol=1e-15) * ray
    _, zx, zy = jet(*met[:2])
    normal = np.array([-zx, -zy, 1.0]) / np.sqrt(1 + zx * zx + zy * zy)
    cosine = ray @ normal
    if eta:
        ray = eta * ray + (np.sqrt(1 - eta**2 * (1 - cosine**2)) - eta * cosine) * normal
    else:
        ray = ray - 2 * cosine * normal
    for turn, shift in reversed(frames):
        met, ray = turn.apply(met) + shift, turn.apply(ray)
    return met, ray


def on_target(start, ray, p, turn, position):
    """Return x and y of a ray on a target that is moved along its own axes, which a rotation turns."""
    middle = turn.apply(p.target_shift) + position
    axes = (turn * Rotation.from_rotvec(p.target_tilt)).apply(np.eye(3))  # rows: in the frame of the scene
    t = (middle - start) @ axes[2] / (ray @ axes[2])
    return (start + t * ray - middle) @ axes[:2].T


def traced_by_numpy(lens, p, origin, direction, target_z, source_z):
    """Return x and y on the moved target of one ray of the source, in the world's frame.

    The lens has been made already (thickness, index, powers).
    """
    start, ray = from_source(p, origin, direction, source_z)
    own = Rotation.from_rotvec(p.lens_tilt), np.array(p.lens_shift)
    front = Rotation.from_rotvec(p.front_tilt), np.array(p.front_shift)
    rear = Rotation.identity(), np.array([0.0, 0.0, lens.thickness])
    start, ray = through(start, ray, [own, front], shaped(lens.front, p.front_error), 1 / lens.index)
    start, ray = through(start, ray, [own, rear], shaped(lens.rear, p.rear_error), lens.index)
    return on_target(start, ray, p, Rotation.identity(), (0.0, 0.0, target_z))


def few(system, **amounts):
    """Return amounts that leave all tolerances out but some."""
    return {t.name: 0.0 for t in tolerances_of(system)} | amounts
