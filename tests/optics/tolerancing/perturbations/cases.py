"""Small systems for the tests of tolerances, and a ray through a perturbed lens by numpy alone."""

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from optics.scene.problem import load_problem
from optics.scene.system import OpticalSystem
from optics.tolerancing.perturbations import PerturbedLight, tolerances_of
from tests.optics.cases import rough, write_problem
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


def small_system(folder, changes=None, height=0.02):
    """Return (system, lens) of the small problem with a rough rear."""
    system = OpticalSystem(load_problem(write_problem(folder, changes)))
    sags = [THBSurface(s.space, rough(s.space, height)) for s in system.lens.sags]
    return system, system.lens.with_sags(sags)


def small_light(folder, backend, changes=None, height=0.02, per_pixel=None):
    """Return the PerturbedLight of the small problem with a rough rear."""
    return PerturbedLight(*small_system(folder, changes, height), backend, per_pixel)


def traced_by_numpy(lens, p, origin, direction, target_z, source_z):
    """Return x and y on the moved target of one ray of the source, in the world's frame.

    Surfaces are roots of F(X) = z - f(x, y) of the point in the lens's own frame, met by bisection; the lens
    has been made already (thickness, index, powers).
    """
    lens_turn, source_turn, target_turn = (
        Rotation.from_rotvec(t) for t in (p.lens_tilt, p.source_tilt, p.target_tilt)
    )
    pivot = np.array([0, 0, source_z])
    start = source_turn.apply(origin - pivot) + pivot + p.source_shift
    ray = source_turn.apply(direction)

    front_turn = Rotation.from_rotvec(p.front_tilt)
    front_shift = lens_turn.apply(p.front_shift) + p.lens_shift

    for surface, vertex, error, eta, turn, shift in (
        (lens.front, 0.0, p.front_error, 1 / lens.index, lens_turn * front_turn, front_shift),
        (lens.rear, lens.thickness, p.rear_error, lens.index, lens_turn, np.asarray(p.lens_shift)),
    ):

        def in_own_frame(point, turn=turn, shift=shift):
            return turn.apply(point - shift, inverse=True)

        def height(t, start=start, ray=ray, surface=surface, vertex=vertex, error=error, own=in_own_frame):
            x, y, z = own(start + t * ray)
            x, y = (np.clip(a, -h, h) for a, h in zip((x, y), surface.half_width))
            dh = 0.0 if error is None else error.jet(np.array([x]), np.array([y]))[0, 0]
            return z - vertex - surface(x, y) - dh

        guess = (vertex - start[2]) / ray[2]
        t = brentq(height, guess - 3, guess + 4, xtol=1e-14, rtol=1e-15)
        start = start + t * ray
        x, y, _ = in_own_frame(start)
        slope = np.array([surface(x, y, d) for d in ((1, 0), (0, 1))])
        if error is not None:
            slope = slope + error.jet(np.array([x]), np.array([y]))[1:, 0]
        normal = turn.apply(np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1 + slope @ slope))
        cosine = ray @ normal
        ray = eta * ray + (np.sqrt(1 - eta**2 * (1 - cosine**2)) - eta * cosine) * normal
    middle = np.array([0, 0, target_z]) + p.target_shift
    axes = target_turn.apply(np.eye(3))  # rows: the target's own axes in the world
    t = (middle - start) @ axes[2] / (ray @ axes[2])
    return (start + t * ray - middle) @ axes[:2].T


def few(system, **amounts):
    """Return amounts that leave all tolerances out but some."""
    return {t.name: 0.0 for t in tolerances_of(system)} | amounts
