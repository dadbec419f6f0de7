"""Light by other ways than front and rear, against the trace that splits every ray at every face."""

from dataclasses import asdict

import numpy as np
import pytest

from optics.light.analysis.closed_lens_light import (
    NEGLIGIBLE,
    PILOT,
    THROUGH,
    _through_front_and_rear,
    nonsequential_light,
)
from optics.light.analysis.metrics import measure
from optics.light.tracing import TargetArea, trace_nonsequential
from optics.scene.receivers import receiver_at
from optics.scene.sources import single_rays
from optics.scene.system import System
from tests.optics.cases import DOME, example_system, flat_problem, roughened, small_system

STRONG = DOME | {"source.flux": 3.0, "target.pixels": [10, 8]}
POINT = {"source.kind": "point", "source.half_angle": 85.0, "source.exponent": 1.0}
NARROW = {"source.half_angle": 20.0}


def system_of(folder, changes):
    return small_system(folder, STRONG | changes)


@pytest.fixture(
    scope="module",
    params=[pytest.param({}, id="lambertian"), pytest.param(POINT, id="point")],
)
def found(request, tmp_path_factory, backend):
    """Return (system, lens, OtherLight, metrics with it)."""
    system, light = system_of(tmp_path_factory.mktemp("ways"), request.param), []
    lens = roughened(system.base, 0.5)

    def kept(*arguments):
        light.append(nonsequential_light(*arguments))
        return light[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("optics.light.analysis.light_by_all_ways.nonsequential_light", kept)
        metrics = measure(system.with_lens(lens), backend).metrics
    other = light[-1]  # noise of the first rays may ask for more
    return system, lens, other, metrics


@pytest.mark.slow
def test_the_image_is_that_of_all_branches_but_the_direct_ones(found, backend):
    """Every branch followed to 1e-4 of its ray's flux; both are samples, so that their errors add up."""
    system, lens, other, _ = found
    screen = system.target.screen()
    rays = single_rays(system.source.rays((400, 400), np.random.default_rng(11)), lens)
    every = trace_nonsequential(backend, lens, rays, TargetArea(system.target.receiver, screen.half_width))
    points, flux = every.landings.points[~every.direct], every.landings.flux[~every.direct]
    through = np.isin(every.fate[~every.direct], THROUGH)
    image, square = (screen.binned(points[through], flux[through] ** k) for k in (1, 2))
    error = np.hypot(other.light.error * screen.pixel_area, np.sqrt(square))
    away = other.light.irradiance * screen.pixel_area - image
    assert np.linalg.norm(away) < 1.5 * np.linalg.norm(error) < 0.15 * np.linalg.norm(image)
    assert other.light.on_target == pytest.approx(image.sum(), rel=0.01)
    assert other.share > NEGLIGIBLE


@pytest.mark.slow
def test_roulette_loses_no_flux_on_average(found, backend):
    """The fates of all light sum to the source's, to the spread of the replicates' sums."""
    _, _, other, _ = found
    assert sum(asdict(other.fates).values()) == pytest.approx(3.0, rel=2e-3)
    assert other.fates.trapped < 1e-6
    assert other.fates.failed == 0


@pytest.mark.slow
def test_metrics_are_those_of_all_light(found):
    _, _, _, metrics = found
    count = metrics["nonsequential"]
    assert metrics["paths"] == "all"
    assert metrics["rel_l2"] != pytest.approx(metrics["rel_l2_sequential"], rel=1e-3)
    assert metrics["efficiency"] == pytest.approx(
        metrics["fates_w"]["on_target"] / 3 + count["by_other_ways"] * count["target_w"] / 3, rel=1e-12
    )
    assert metrics["lit_efficiency"] == pytest.approx(count["lit_w"] / 3, rel=1e-12)
    assert 0 < count["lit_direct_w"] < count["lit_w"] < count["target_w"]
    assert metrics["rel_l2_error"] < 0.05 * metrics["rel_l2"]


def test_where_next_to_nothing_comes_by_other_ways_a_few_rays_say_so(tmp_path, backend, monkeypatch):
    system, replicates, real = system_of(tmp_path, NARROW), [], _through_front_and_rear

    def watched(*arguments):
        replicates.append(real(*arguments))
        return replicates[-1]

    monkeypatch.setattr("optics.light.analysis.closed_lens_light._through_front_and_rear", watched)
    metrics = measure(system, backend).metrics
    assert len(replicates) == PILOT
    assert metrics["paths"] == "sequential"
    assert metrics["nonsequential"]["by_other_ways"] < NEGLIGIBLE
    assert metrics["rel_l2_debiased"] == metrics["rel_l2_sequential"]
    assert metrics["rel_l2_error"] == metrics["rel_l2_sequential_error"]


@pytest.mark.slow
def test_light_beside_the_lens_counts_nowhere(tmp_path, backend):
    """A cone three times as wide as the lens: what passes beside it would meet the target too."""
    wide = {"source.distance": 20.0, "target.half_width": [3000.0, 3000.0], "target.distance": 300.0}
    system = system_of(tmp_path, POINT | wide)
    other = nonsequential_light(system, system.target.screen(), backend)
    assert other.fates.beside_lens > 1.0
    on_pixels = other.light.irradiance.sum() * system.target.screen().pixel_area
    assert on_pixels == pytest.approx(other.light.on_target, rel=1e-9)  # which the fates tell


@pytest.mark.slow
def test_the_seed_is_the_problems(tmp_path, backend):
    """The same bytes again; another seed other rays."""
    system, again, other = (system_of(tmp_path, NARROW | {"run.seed": seed}) for seed in (0, 0, 1))
    one, same, different = (
        nonsequential_light(s, s.target.screen(), backend).light.irradiance for s in (system, again, other)
    )
    assert one.tobytes() == same.tobytes()
    assert not np.array_equal(one, different)


@pytest.mark.parametrize(
    ("changes", "follows"),
    [
        ({}, True),
        (POINT, True),
        ({"source.kind": "collimated", "lens.front.radius": np.inf, "lens.thickness": 8.0}, False),
        ({"source.kind": "collimated"}, True),
        ({"target.distance": np.inf, "target.half_width": [60.0, 60.0]}, True),
    ],
    ids=["lambertian", "point", "collimated", "collimated before a curved front", "far field"],
)
def test_light_that_may_meet_edges_is_followed(tmp_path, changes, follows):
    assert system_of(tmp_path, changes).by_edges is follows


@pytest.mark.slow
def test_light_in_the_far_field_is_what_leaves_the_lens_in_its_directions(tmp_path, backend):
    """By any of its faces, counted by the tangents of direction alone."""
    system = system_of(tmp_path, {"target.distance": np.inf, "target.half_width": [40.0, 30.0]})
    metrics = measure(system, backend).metrics
    rays = single_rays(system.source.rays((200, 200), np.random.default_rng(11)), system.base)
    plane = TargetArea(receiver_at(100.0), (1.0, 1.0))
    out = trace_nonsequential(backend, system.base, rays, plane).departures
    p, q, r = out.direction
    within = (r > 0) & (abs(p) < np.tan(np.radians(40)) * r) & (abs(q) < np.tan(np.radians(30)) * r)
    assert metrics["paths"] == "all"
    assert metrics["efficiency"] == pytest.approx(out.flux[within].sum() / rays.total, rel=0.01)
    forward = out.flux[(r > 0) & ~within].sum() / rays.total
    assert metrics["stray"] == pytest.approx(forward, rel=0.02)
    assert metrics["nonsequential"]["by_other_ways"] > NEGLIGIBLE


@pytest.mark.slow
@pytest.mark.parametrize(("half", "paths"), [(4.5, "all"), (1.0, "sequential")])
def test_a_beam_that_a_front_spreads_past_the_rear_counts_by_all_ways(tmp_path, backend, half, paths):
    """A wide beam meets the hollow front where that sends much of it into the edges, a narrow one nowhere."""
    beam = {
        "source.kind": "collimated",
        "source.half_width": [half, half],
        "lens.rear.half_width": [5.0, 5.0],
    }
    system = system_of(tmp_path, beam)
    metrics = measure(system, backend).metrics
    assert metrics["paths"] == paths
    assert (metrics["fates_w"]["missed_rear"] > 0.05) is (paths == "all")
    assert ("nonsequential" in metrics) is (paths == "all")


@pytest.mark.slow
def test_light_that_the_walls_of_a_body_take_from_the_rear_is_no_light_through_it(tmp_path, backend):
    """Parallel light up to the rear leaves by it within the foot of the walls alone, but for what inner
    reflections bring: a hundredth of the light."""
    keys = {"lens.body.draft": 30.0, "lens.body.parting": 0.5, "target.half_width": [12.0, 12.0]}
    system = small_system(tmp_path, keys)
    metrics = measure(system, backend).metrics
    assert metrics["paths"] == "all"
    assert metrics["nonsequential"]["by_other_ways"] < -NEGLIGIBLE
    through, closed = metrics["fates_w"], metrics["nonsequential"]["fates_w"]
    share = system.solid.feet[1].area / np.prod(2 * np.array(system.problem.source.half_width))
    rear = closed["on_target"] + closed["off_target"]
    assert rear / (through["on_target"] + through["off_target"]) == pytest.approx(share, abs=0.01)
    assert metrics["efficiency"] == pytest.approx(closed["on_target"], abs=0.01)


@pytest.mark.slow
def test_what_the_walls_send_beside_the_target_is_stray(backend):
    """Next to nothing of it lands on the target, so that the light there is that of front and rear alone.
    Light past the lens is stray too: it goes on past the target."""
    thick = {"lens.thickness": 25.0, "lens.rear.radius": -60.0, "lens.rear.conic": -1.0}
    wide = {"source.half_angle": 70.0, "target.half_width": (400.0, 400.0), "target.pixels": (16, 16)}
    free = {"lens.rear.freeform.max_level": 0, "lens.rear.freeform.z_freedom": 1.0}
    system = example_system("spot", thick | wide | free)
    metrics = measure(system, backend).metrics
    fates, flux = metrics["nonsequential"]["fates_w"], system.problem.flux
    assert metrics["paths"] == "sequential"
    assert fates["edges_off_target"] > 0.05 * flux
    stray = fates["beside_lens"] + sum(fates[f"{way}off_target"] for way in ("", "edges_", "front_"))
    assert metrics["stray"] * flux == pytest.approx(stray, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("half_angle", "changes"),
    [(60.0, {"surface": "sphere", "radius": 15.0}), (30.0, {"tilt": (0.0, 80.0, 0.0)})],
    ids=["past a sphere", "away from a wall"],
)
def test_light_that_never_meets_the_target_is_stray(backend, half_angle, changes):
    """As front and rear alone count it, with light past the lens; past a sphere also what the walls send."""
    source = {"kind": "point", "half_angle": half_angle, "distance": 8.0}
    system = System(flat_problem(source, changes, {"thickness": 9}))
    metrics = measure(system, backend).metrics
    fates, direct = metrics["nonsequential"]["fates_w"], metrics["fates_w"]
    beside = fates["beside_lens"]  # all of which passes beside the target too
    through = fates["off_target"] + fates["front_off_target"]
    assert metrics["stray"] == pytest.approx(through + beside, rel=0.02)
    assert metrics["stray"] - beside > direct["off_target"] > 0.2
    if "surface" in changes:
        rays = single_rays(system.source.rays((200, 200), np.random.default_rng(11)), system.base)
        plane = TargetArea(receiver_at(69.0), (1.0, 1.0))
        forward = trace_nonsequential(backend, system.base, rays, plane).fates
        arriving = metrics["stray"] - beside + fates["on_target"]
        assert arriving == pytest.approx(forward.onto + forward.beside, rel=0.02)
