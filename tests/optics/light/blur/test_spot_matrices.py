"""How far landing points move, against closed forms of a plate and against rays traced by numpy."""

import numpy as np
import pytest

from optics.light.blur.spot_matrices import landing_shifts
from tests.optics.cases import roughened, small_system, target_z

PLATE = {"lens.rear.radius": np.inf, "lens.rear.conic": 0.0, "target.distance": 200.0}
DIAGONAL = np.eye(2)


def shifts_of(folder, changes, backend, bumps=0.0):
    system = small_system(folder, changes)
    lens = roughened(system.base, bumps)
    return landing_shifts(system, system.with_lens(lens).path, backend), system, lens


def test_behind_a_plate_angles_grow_to_lengths(tmp_path, backend):
    """A beam keeps its angles; the rear turns light by (n - 1) s, the front as much in the other sense."""
    shifts, system, _ = shifts_of(tmp_path, PLATE, backend)
    length, n = 200.0, system.base.index
    np.testing.assert_allclose(shifts.beam, length * DIAGONAL, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(shifts.rear, length * (n - 1) * DIAGONAL, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(shifts.front, -length * (n - 1) * DIAGONAL, rtol=1e-6, atol=1e-6)
    assert shifts.variation < 1e-6


def test_in_the_far_field_shifts_are_angles(tmp_path, backend):
    changes = PLATE | {"target.distance": np.inf, "target.half_width": [10.0, 10.0]}
    shifts, _, _ = shifts_of(tmp_path, changes, backend)
    np.testing.assert_allclose(shifts.beam, np.degrees(1.0) * DIAGONAL, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    "front", [{}, {"lens.front.radius": 60.0, "lens.front.conic": -1.0}], ids=["plane", "curved"]
)
def test_light_of_one_point_of_the_rear_lands_in_one_spot(tmp_path, backend, front):
    """Rays by numpy, traced back from points of a bumpy rear to parallel beams in two directions."""
    shifts, system, lens = shifts_of(tmp_path, front | {"target.distance": 150.0}, backend, bumps=0.1)
    x, y = (c.ravel() for c in np.meshgrid(*[np.linspace(-8, 8, 41)] * 2))
    out = []
    for k in range(2):
        for step in (1e-4, -1e-4):
            beam = np.zeros(3)
            beam[k], beam[2] = step, np.sqrt(1 - step**2)
            out.append(landing(lens, target_z(system.problem), x, y, inside(lens, x, y, beam)))
    mean = [((a - b) / 2e-4).mean(axis=1) for a, b in (out[:2], out[2:])]
    np.testing.assert_allclose(shifts.beam, np.stack(mean, axis=1), rtol=5e-3, atol=0.5)


def inside(lens, x, y, beam):
    """The direction inside the lens of light that comes along a beam and meets the rear at x, y."""
    height = lens.thickness + lens.rear(x, y)
    fx, fy = x.copy(), y.copy()
    for _ in range(60):  # of a fixed point: the front's point from which the refracted ray meets the rear
        slopes = [lens.front(fx, fy, d) for d in ((1, 0), (0, 1))]
        a = bent(np.broadcast_to(beam[:, None], (3, x.size)), slopes, 1 / lens.index)
        way = (height - lens.front(fx, fy)) / a[2]
        fx, fy = x - way * a[0], y - way * a[1]
    return a


def landing(lens, z, x, y, a):
    """Where light of directions a inside lands that leaves the rear at x, y."""
    d = bent(a, [lens.rear(x, y, d) for d in ((1, 0), (0, 1))], lens.index)
    way = (z - lens.thickness - lens.rear(x, y)) / d[2]
    return np.stack([x + way * d[0], y + way * d[1]])


def bent(d, slopes, eta):
    """Snell's law for unit directions (3, n) at slopes (zx, zy).  eta : index before / index behind."""
    normal = np.stack([-slopes[0], -slopes[1], np.ones_like(slopes[0])])
    normal /= np.linalg.norm(normal, axis=0)
    cosine = (d * normal).sum(axis=0)
    return eta * d + (np.sqrt(1 - eta**2 * (1 - cosine**2)) - eta * cosine) * normal
