"""Stops and clear apertures: what they take of the light, by closed forms of areas and solid angles."""

import numpy as np
import pytest

import optics
from optics.light.analysis import cell_irradiance
from optics.light.tracing import TargetArea, Tracer, trace_nonsequential, transmittances
from optics.scene.problem import Problem
from optics.scene.sources import Rays, single_rays
from optics.scene.system import System, solvable_system
from tests.optics.cases import flat_problem

BORDER_CELLS = 2000  # of the finest cells across the source
HALF, DISTANCE = 8.0, 20.0  # mm: of the beam; from a point to the front
GLASS = 0.96**2  # what two bare faces of n = 1.5 leave
BOTH_SIDES = (  # of the lens
    {"shape": "rectangle", "half_width": (6, 4), "position": (1, 0, -9), "tilt": (0, 35, 0)},
    {"shape": "ellipse", "half_width": (2, 1), "position": (1, 2, 30), "tilt": (40, 0, 0), "hole": False},
)


def problem(**changes: object) -> Problem:
    beam = {"kind": "collimated", "half_width": (HALF, HALF), "distance": DISTANCE}
    return flat_problem(beam, {"pixels": (32, 32)}).with_(**changes)


def system(*stops: dict[str, object], **changes: object) -> System:
    return solvable_system(problem(stop=stops, **changes))


def light(scene: System):
    """Return (irradiance, fates) by cells."""
    cells = scene.source.cells((48, 48))
    image, fates = cell_irradiance(scene.path, scene.target.screen(), cells, scene.backend)
    assert fates.total == pytest.approx(1, abs=1e-12)
    return image, fates


def chords(radius: float) -> float:
    """Return how much less area chords of the cells at a border enclose than a circle: (h / r)^2 / 6."""
    return (2 * HALF / BORDER_CELLS / radius) ** 2 / 6


@pytest.mark.parametrize(("z", "share"), [(-5.0, 1.0), (20.0, GLASS)])
@pytest.mark.parametrize("hole", [False, True])
def test_a_disk_in_a_uniform_beam_takes_its_area_and_a_hole_leaves_it(z, share, hole):
    disk = np.pi * 9 / (2 * HALF) ** 2
    _, fates = light(
        system({"shape": "ellipse", "half_width": (3, 3), "position": (0.5, 1, z), "hole": hole})
    )
    wanted = 1 - disk if hole else disk
    assert fates.blocked / share == pytest.approx(wanted, abs=2 * disk * chords(3.0))


def test_a_tilted_ring_takes_its_projection():
    ring = {"shape": "ring", "half_width": (2.5, 3), "inner": (1, 1.5), "position": (0.3, 0, 25)}
    _, fates = light(system({**ring, "tilt": (0, 40, 30), "hole": False}))
    area = np.pi * (2.5 * 3 - 1.5) * np.cos(np.radians(40))
    assert fates.blocked / GLASS == pytest.approx(area / (2 * HALF) ** 2, rel=2 * chords(0.7))


def test_a_hole_before_a_point_source_leaves_its_solid_angle():
    hole = {"shape": "ellipse", "half_width": (3, 3), "position": (0, 0, -5)}
    point = {"kind": "point", "distance": DISTANCE, "half_angle": 20}
    _, fates = light(system(hole, source=point))
    cone = (1 - np.cos(np.arctan(3 / (DISTANCE - 5)))) / (1 - np.cos(np.radians(20)))
    assert 1 - fates.blocked == pytest.approx(cone, rel=1e-6)  # cells of a cone are smaller at its middle


def test_the_shadow_of_a_rectangle_has_its_exact_area_on_every_pixel():
    """Parallel light through a plate lands where it came in."""
    bar = {"shape": "rectangle", "half_width": (2.3, 4.1), "position": (0.7, -1.2, 30), "hole": False}
    image, _ = light(system(bar))
    borders = np.linspace(-12, 12, 33)

    def overlap(low: float, high: float) -> np.ndarray:
        return np.clip(np.minimum(borders[1:], high) - np.maximum(borders[:-1], low), 0, None)

    beam = np.outer(overlap(-HALF, HALF), overlap(-HALF, HALF))
    shadow = np.outer(overlap(-5.3, 2.9), overlap(-1.6, 3.0))[::-1]
    wanted = GLASS * (beam - shadow) / (2 * HALF) ** 2 / 0.75**2
    # a corner of the shadow within one of the finest cells is cut by a chord
    np.testing.assert_allclose(image, wanted, atol=wanted.max() * (2 * HALF / BORDER_CELLS / 0.75) ** 2)


def test_a_clear_aperture_leaves_its_area():
    _, fates = light(system(**{"lens.clear_aperture": (5, 4)}))
    assert fates.blocked == pytest.approx(1 - 20 / HALF**2, abs=1e-8)  # corners: (h / 5 mm)^2
    round_lens = {"lens.outline": "round", "lens.clear_aperture": (5, 5)}
    _, fates = light(system(**round_lens))
    assert fates.transmitted / GLASS == pytest.approx(np.pi * 25 / (2 * HALF) ** 2, rel=2 * chords(5.0))


def test_rays_with_known_meeting_points_are_blocked_like_all_others():
    scene = system(*BOTH_SIDES, **{"lens.clear_aperture": (7, 3)})
    lens, rays = scene.base, scene.source.rays((61, 53))
    seen = []
    for some in (rays, single_rays(rays, lens)):
        tracer = Tracer(scene.backend, scene.with_lens(lens).path, some)
        _, landing = tracer.trace()
        seen.append((tracer.fates(landing, (12, 12)), tracer.counts(landing, (12, 12))))
    (fates, counts), (others, other_counts) = seen
    assert counts == other_counts
    assert counts["blocked"] > 1000
    assert fates.by_name == pytest.approx(others.by_name, abs=1e-13)


def all_ways(scene: System):
    """Return the result of a trace with all reflections."""
    rays, area = single_rays(scene.source.rays((31, 29)), scene.base), (12.0, 12.0)
    target = TargetArea.of(scene.path, area)
    result = trace_nonsequential(scene.backend, scene.base, rays, target, threshold=1e-14)
    np.testing.assert_allclose(result.by_ray.sum(axis=0), rays.flux, rtol=1e-12)
    return result


def test_light_by_front_and_rear_alone_is_blocked_alike_in_both_traces():
    scene = system(*BOTH_SIDES, **{"lens.clear_aperture": (7, 3)})
    result = all_ways(scene)
    tracer = Tracer(scene.backend, scene.path, scene.source.rays((31, 29)))
    _, landing = tracer.trace()
    direct = result.landings.flux[result.direct].sum()
    assert direct == pytest.approx(tracer.fates(landing, (12, 12)).on_target, abs=1e-13)


def test_behind_a_plate_all_that_goes_through_is_blocked_and_before_it_nothing_comes_back():
    """A plate of glass passes 2 n / (n^2 + 1) with all its reflections, and sends the rest back."""
    wide = {"shape": "rectangle", "half_width": (20, 20), "hole": False}
    behind = all_ways(system({**wide, "position": (0, 0, 30)})).fates
    passed = 3 / (1.5**2 + 1)
    assert behind.blocked == pytest.approx(passed, abs=1e-12)
    assert behind.back + behind.reflected_outside == pytest.approx(1 - passed, abs=1e-12)
    assert all_ways(system({**wide, "position": (0, 0, -5)})).fates.blocked == pytest.approx(1, abs=1e-12)


def test_what_the_front_reflects_meets_the_plate_from_behind():
    scene = system({"shape": "ellipse", "half_width": (9, 9), "position": (0, 0, -3)})
    target = TargetArea.of(scene.path, (12.0, 12.0))
    direction = np.array([0.5, 0.0, np.sqrt(0.75)])
    start = np.array([8.0, 0.0, -3.0]) - direction  # through the hole at 8 mm, and back at 11.5 mm
    ray = Rays(start[:, None], direction[:, None], np.ones(1))
    fates = trace_nonsequential(scene.backend, scene.base, ray, target).fates
    reflected = 1 - np.mean(transmittances(1.0, 1.5, np.pi / 6))
    assert fates.reflected_outside == 0
    assert fates.blocked >= reflected - 1e-12


def test_nothing_is_said_of_blocked_light_where_nothing_blocks():
    scene = system()
    tracer = Tracer(scene.backend, scene.path, scene.source.rays((8, 8)))
    _, landing = tracer.trace()
    assert "blocked" not in tracer.fates(landing, (12, 12)).by_name
    assert "blocked" not in tracer.counts(landing, (12, 12))


@pytest.mark.parametrize("window", ["bspline", "cells"])
@pytest.mark.parametrize(
    "source", [{"kind": "collimated", "half_width": (HALF, HALF)}, {"kind": "point", "half_angle": 25}]
)
def test_gradients_beside_the_kinks_know_of_what_blocks(source, window):
    """One stop stands behind the free rear, so that rays move over it; few of them come near its rim."""
    stops = (
        {"shape": "ellipse", "half_width": (6, 5), "position": (0.5, 0, -6), "tilt": (0, 10, 0)},
        {"shape": "ellipse", "half_width": (2, 3), "position": (0.5, 0, 25), "hole": False},
    )
    changes = {"source": {"distance": DISTANCE, **source}, "optimizer.window": window}
    changes |= {"target.pixels": (16, 16), "lens.rear.freeform.spans": (3, 3), "lens.outline": "round"}
    blocked = optics.System(problem(stop=stops, **changes, **{"lens.clear_aperture": (7, 7)}))
    space = blocked.space(level=0)
    model, free = (s.model(space, rays=(41, 41)) for s in (blocked, optics.System(problem(**changes))))
    c, along = 0.05 * np.random.default_rng(3).normal(size=(2, space.dim))
    loss, slope = model.loss(c)
    assert abs(free.loss(c)[0] - loss) > 1e-2 * loss
    step = 1e-5  # differences of fourth order: rounding of the loss is 1e-16 / 1e-5, and they err by less
    a, b, far_a, far_b = (model.loss(c + k * step * along)[0] for k in (1, -1, 2, -2))
    difference = (8 * (a - b) - (far_a - far_b)) / (12 * step)
    assert slope @ along == pytest.approx(difference, rel=1e-8)
