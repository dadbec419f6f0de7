"""The wall of lenses with rounded corners: sections by polynomials, rods in closed form, a triangle mesh."""

from dataclasses import replace

import numpy as np
import pytest

from optics.light.tracing import FATES, TargetArea, trace_nonsequential
from optics.scene.receivers import receiver_at
from optics.scene.sources import Rays
from oracles.branch_tracer import INDEX, LevelSolid, MeshSolid, traced_one_by_one
from oracles.polarised_faces import SmoothFace, follow
from tests.optics.light.tracing.cases import lambertian
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

WIDE = TargetArea(receiver_at(50.0), (30.0, 20.0))


def outlined(half_width, relative, conic=None):
    return FreeformSurface(
        half_width, conic or Conic(), corners=tuple(r * h for r, h in zip(relative, half_width))
    )


def level_lens(front, rear, relative, thickness):
    return Lens(outlined(front, relative), outlined(rear, relative), thickness, INDEX)


def rays_around(n, seed=1):
    rng = np.random.default_rng(seed)
    origin = np.vstack([rng.uniform(-9, 9, (2, n)), rng.uniform(-6, -1, n)])
    direction = rng.normal(size=(3, n))
    direction[2] = abs(direction[2])
    direction[:2, : n // 5] = 0.0  # along z
    direction[:2, n // 5 : n // 3] = -origin[:2, n // 5 : n // 3]  # to the axis
    return Rays(origin, direction / np.linalg.norm(direction, axis=0), np.ones(n))


SHAPES = {
    "rod": ((5.0, 5.0), (5.0, 5.0), (1.0, 1.0), 10.0),
    "cone": ((5.0, 5.0), (8.0, 8.0), (1.0, 1.0), 5.0),
    "narrowing cone": ((8.0, 8.0), (3.0, 3.0), (1.0, 1.0), 20.0),
    "crossing ellipses": ((5.0, 4.0), (3.0, 7.0), (1.0, 1.0), 5.0),
    "rounded": ((5.0, 4.0), (5.0, 4.0), (0.3, 0.5), 6.0),
    "rounded, unlike": ((5.0, 4.0), (8.0, 7.0), (0.3, 0.5), 5.0),
    "rounded, one side upright": ((5.0, 4.0), (5.0, 7.0), (0.05, 0.1), 5.0),
    "nearly a cylinder": ((5.0, 5.0), (5.0 + 1e-10, 5.0 - 1e-6), (1.0, 1.0), 5.0),
}


QUICK = "crossing ellipses", "rounded, one side upright"


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("shape", "absorbing"),
    [
        *(pytest.param(name, False, marks=[] if name in QUICK else pytest.mark.slow) for name in SHAPES),
        ("cone", True),
        pytest.param("rounded, unlike", True, marks=pytest.mark.slow),
    ],
)
def test_every_branch_between_level_rims(backend, shape, absorbing):
    shape = SHAPES[shape]
    rays, landings = rays_around(40), []
    result = trace_nonsequential(backend, level_lens(*shape), rays, replace(WIDE, absorbing_wall=absorbing))
    expected = traced_one_by_one(
        LevelSolid(*shape), rays, WIDE, 1e-4, absorbing_wall=absorbing, landings=landings
    )
    # some 20 meetings, each of which may double an error of 1e-16 in a direction
    assert result.by_ray == pytest.approx(expected, abs=1e-10)
    assert result.by_ray.sum(axis=0) == pytest.approx(rays.flux, rel=1e-12)
    assert (result.fates.blocked > 0) == absorbing
    assert result.fates.failed == 0
    through = np.array([name.endswith("_target") for name in FATES])[result.fate]
    x, y, flux = *result.landings.points[through].T, result.landings.flux[through]
    # a direction moves a point in proportion to the square of its distance; branches of one point differ by
    # their flux
    scale = np.hypot(WIDE.receiver.pose.shift[2], np.hypot(x, y))
    order, other = (
        np.lexsort((np.round(f, 9), np.round(b, 4), np.round(a, 4)))
        for a, b, f in ((x, y, flux), zip(*landings))
    )
    differ = abs(np.column_stack([x, y])[order] - np.array(landings)[other, :2]).max(axis=1)
    assert (differ <= 1e-12 * scale[order] ** 2).all()


def test_a_rod_turns_light_by_equal_angles(backend):
    """In the plan a skew ray in a cylinder runs along equal chords, and total reflection keeps its slope to
    the axis."""
    radius, length, far, n = 3.0, 40.0, 60.0, 200
    rng = np.random.default_rng(4)
    turn, r, azimuth = (
        rng.uniform(0, 2 * np.pi, n),
        radius * np.sqrt(rng.random(n)),
        rng.uniform(0, 2 * np.pi, n),
    )
    start = r * np.exp(1j * turn)
    sine = rng.uniform(0.05, 0.7, n)  # in air; in glass at most 28 degrees to the axis: total at the wall
    onward = np.exp(1j * azimuth)
    direction = np.array([sine * onward.real, sine * onward.imag, np.sqrt(1 - sine**2)])
    origin = np.array([start.real, start.imag, np.zeros(n)]) - direction
    lens = level_lens((radius, radius), (radius, radius), (1.0, 1.0), length)
    result = trace_nonsequential(
        backend,
        lens,
        Rays(origin, direction, np.ones(n)),
        TargetArea(receiver_at(far), (100.0, 100.0)),
        bounces=60,
    )
    slope = sine / INDEX / np.sqrt(1 - (sine / INDEX) ** 2)
    inner = (start * onward.conj()).real
    half = np.sqrt(radius**2 - (start * onward.conj()).imag ** 2)  # of a chord
    chords, rest = np.divmod(length * slope + half + inner, 2 * half)
    turn_each = np.exp(2j * np.arcsin(half / radius) * np.sign((start.conj() * onward).imag))
    turned = turn_each**chords
    foot = (start - inner * onward) * turned  # the middle of the last chord
    end = (
        foot
        + (rest - half) * onward * turned
        + (far - length) * sine / np.sqrt(1 - sine**2) * onward * turned
    )
    best = np.zeros(n)
    np.maximum.at(best, result.ray, result.landings.flux)
    strongest = result.landings.flux == best[result.ray]
    assert strongest.sum() == n
    wall = (start - inner * onward + half * onward) / radius  # where the first chord ends
    passed = np.array([through_rod(*ray) for ray in zip(direction.T, wall, turn_each, chords)])
    found = result.landings.points[strongest][np.argsort(result.ray[strongest])]
    assert chords.max() > 5
    assert best == pytest.approx(passed, rel=1e-12)
    assert found[:, 0] + 1j * found[:, 1] == pytest.approx(end, abs=1e-10)


def through_rod(direction, wall, turn, chords):
    """Return what passes both ends of a rod: total reflection between them turns the polarisation."""
    end = np.array([[0.0, 0.0, 1.0]])
    walls = [wall * turn**k for k in range(int(chords))]
    normals = [np.array([[w.real, w.imag, 0.0]]) for w in walls]
    within = [SmoothFace(normal, INDEX, 1.0, reflects=True) for normal in normals]
    faces = [SmoothFace(end, 1.0, INDEX), *within, SmoothFace(end, INDEX, 1.0)]
    return follow(direction[None], faces).stokes[0, 0]


def wavy(surface, seed, amplitude=0.3):
    kv = [KnotVector.uniform(3, 4, -h, h) for h in surface.half_width]
    space = THBSpace(*kv)
    return surface.with_sag(
        THBSurface(space, amplitude * np.random.default_rng(seed).uniform(-1, 1, space.dim))
    )


CURVED = {
    "round dome": Lens(
        wavy(outlined((5.0, 5.0), (1.0, 1.0), Conic(-12.0)), 1),
        wavy(outlined((8.0, 8.0), (1.0, 1.0), Conic(-14.0, -1.0)), 2),
        6.0,
        INDEX,
    ),
    "rounded": Lens(
        wavy(outlined((6.0, 5.0), (0.4, 0.5), Conic(20.0)), 3),
        wavy(outlined((6.0, 5.0), (0.4, 0.5), Conic(-20.0)), 4),
        6.0,
        INDEX,
    ),
    "rounded, rear smaller": Lens(
        wavy(outlined((7.0, 6.0), (0.4, 0.5), Conic(40.0)), 5),
        wavy(outlined((5.0, 5.0), (0.4, 0.5), Conic(-20.0)), 6),
        6.0,
        INDEX,
    ),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if "smaller" in name else pytest.mark.slow) for name in CURVED]
)
def test_every_branch_in_a_triangle_mesh(backend, name):
    lens, rays = CURVED[name], lambertian(80, 5, 6.0, -3.0)
    result = trace_nonsequential(backend, lens, rays, WIDE, threshold=1e-3)
    assert result.by_ray.sum(axis=0) == pytest.approx(rays.flux, rel=1e-12)
    assert result.fates.failed == 0
    meets = result.by_ray[FATES.index("beside_lens")] == 0
    differ = []
    for count in (12, 36):
        expected = traced_one_by_one(MeshSolid(lens, count), rays, WIDE, 1e-3)
        differ.append(abs(expected - result.by_ray).sum(axis=0)[meets] / rays.flux[meets])
    # facets lie h^2 / 8 times the curvature beside the surface: a third of the size, a ninth of it
    assert np.median(differ[1]) < np.median(differ[0]) / 5
    # near the critical angle, a rim or the threshold a branch may end elsewhere
    assert (differ[1] > 0.01).mean() <= 0.06
