"""The flux by all ways through the closed lens, against the sequential trace, and the fans of rays that are
drawn."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from optics.analysis.light_fates import FAN, WIDEST, fans, nonsequential_metrics
from optics.analysis.metrics import measure
from optics.problem import load_problem
from optics.sources import Rays
from optics.system import OpticalSystem
from optics.tracing import FATES, Tracer
from tests.optics.cases import HOLLOW, rough, write_problem
from thbcad.surfaces import THBSurface

DOME = HOLLOW | {  # thesis Table 6.3: a glowing square of 1 mm in the hollow of a dome
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "source.distance": 2.0,
    "source.flux": 3.0,
    "target.kind": "tophat",
    "target.lit": [0.6, 0.4],
    "target.half_width": [2000.0, 1500.0],
    "target.pixels": [40, 30],
}
POINT = {"source.kind": "point", "source.half_angle": 60.0, "source.exponent": 2.0}
SEEN = {
    "dome": {},
    "crescent": {"target.shape": "crescent"},
    "point": POINT,
    "narrow cone": {"source.half_angle": 20.0},
}


def loaded(folder, changes, sag=None):
    """Return the problem, its lens with a sag (a function of the space), and its target's light."""
    problem = load_problem(write_problem(folder, DOME | changes))
    lens = OpticalSystem(problem).lens
    if sag is not None:
        space = lens.rear.sag.space
        lens = lens.with_sags([THBSurface(space, sag(space))])
    return SimpleNamespace(problem=problem, lens=lens, light=OpticalSystem(problem).target.light)


def metrics_of(backend, made, target):
    return nonsequential_metrics(OpticalSystem(made.problem), made.lens, backend, target)


CASES = [("dome", False), ("dome", True), ("crescent", True), ("point", False), ("narrow cone", False)]


@pytest.fixture(scope="module", params=CASES, ids=lambda p: p[0] + ", rough" * p[1])
def seen(request, tmp_path_factory, backend):
    """Return the figures by all ways and those of the sequential trace."""
    name, is_rough = request.param
    made = loaded(
        tmp_path_factory.mktemp("budget"), SEEN[name], (lambda space: rough(space, 0.5)) if is_rough else None
    )
    measured = measure(OpticalSystem(made.problem), made.lens, backend)
    return metrics_of(backend, made, measured.target), measured.metrics


def test_every_figure_is_part_of_the_one_around_it(seen):
    found, _ = seen
    fates = found["fates_w"]
    assert len(found) == 4
    assert sum(fates.values()) == pytest.approx(3.0, rel=1e-12)
    assert min(fates.values()) >= 0
    assert fates["failed"] == 0
    onto = fates["on_target"] + fates["edges_on_target"] + fates["front_on_target"]
    beside = fates["off_target"] + fates["edges_off_target"] + fates["front_off_target"]
    assert 0 < found["lit_direct_w"] < found["lit_w"] <= found["target_w"] <= onto + beside < 3.0
    assert found["target_w"] == pytest.approx(onto, rel=1e-9)  # the pixels tile the rectangle


def test_direct_light_is_that_of_the_sequential_trace(seen):
    """Two samples of the same integral.  On n = 2^16 quasi-random rays only those near the borders of the lit
    region and of the faces count differently, about n^(3/4) of them with random signs: n^(-5/8) = 1e-3 of the
    flux; four times that is allowed.
    """
    found, sequential = seen
    assert found["lit_direct_w"] / 3.0 == pytest.approx(sequential["lit_efficiency"], abs=4e-3)
    budget = sequential["fates_w"]
    assert found["fates_w"]["beside_lens"] == pytest.approx(budget["beside_lens"], abs=0.012)
    assert found["target_w"] > budget["on_target"] - 0.012
    assert found["fates_w"]["reflected_outside"] == pytest.approx(
        budget["front_reflected"], abs=0.05
    )  # some of it comes back from the hollow


def test_light_counts_on_the_lit_pixels_only(tmp_path, backend):
    """Every pixel lit: all light on the target is.  One half and the other make up the whole."""
    made = loaded(tmp_path, {"target.pixels": [20, 16]}, lambda space: rough(space, 0.5))
    upper = np.zeros((16, 20))
    upper[:8] = 0.25
    whole, up, down = (metrics_of(backend, made, t) for t in (np.ones((16, 20)), upper, upper[::-1]))
    assert whole["lit_w"] == pytest.approx(whole["target_w"], rel=1e-14)
    assert up["lit_w"] + down["lit_w"] == pytest.approx(whole["target_w"], rel=1e-12)


def test_plus_y_is_up(tmp_path, backend):
    """A wedge sends light to its thick end: more of it lands on the upper pixels where the lens is thicker at
    +y."""
    upper = np.zeros((16, 20))
    upper[:8] = 0.25
    tilt = loaded(
        tmp_path,
        {"target.pixels": [20, 16]},
        lambda space: np.tile(np.linspace(-1, 1, space.kv_v.dim), space.kv_u.dim),
    )
    up, down = (metrics_of(backend, tilt, t)["lit_direct_w"] for t in (upper, upper[::-1]))
    assert up > 1.05 * down


def test_the_seed_is_the_problems(tmp_path, backend):
    """The same bytes again; another seed other rays."""
    target = np.ones((30, 40))
    one, again, other = (
        metrics_of(backend, loaded(tmp_path, {"run.seed": seed}), target) for seed in (0, 0, 1)
    )
    assert one == again
    assert one["lit_w"] != other["lit_w"]
    assert one["lit_w"] == pytest.approx(other["lit_w"], abs=0.012)


@pytest.mark.parametrize(
    ("changes", "follows"),
    [
        ({}, True),
        (POINT, True),
        ({"source.kind": "collimated"}, False),
        ({"target.distance": np.inf, "target.half_width": [60.0, 60.0]}, False),
    ],
    ids=["lambertian", "point", "collimated", "far field"],
)
def test_only_spreading_light_to_a_plane_is_followed(tmp_path, changes, follows):
    assert OpticalSystem(loaded(tmp_path, changes).problem).path.by_edges is follows


# Fans


@pytest.mark.parametrize("half_angle", [90.0, 20.0])
def test_fans_start_from_the_sources_middle_in_the_plane_of_y_and_z(tmp_path, backend, half_angle):
    """A lens that is its own mirror image in x keeps every path in the plane; first segments show the
    directions."""
    made = loaded(tmp_path, {"source.half_angle": half_angle})
    found = fans(OpticalSystem(made.problem), made.lens, backend)
    assert sorted(found) == ["equal angles", "equal steps of the sine"]
    widest = WIDEST * half_angle
    for name, paths in found.items():
        assert len(paths) == FAN == 8
        for path in paths:
            assert path.fate in FATES
            np.testing.assert_array_equal(path.points[0], [0, 0, -2])
            np.testing.assert_allclose(path.points[:, 0], 0, atol=1e-9)
        first = np.array([path.points[1] - path.points[0] for path in paths])
        angle = np.degrees(np.arctan2(first[:, 1], first[:, 2]))
        assert angle[[0, -1]] == pytest.approx([-widest, widest], rel=1e-9)
        steps = np.diff(angle if name == "equal angles" else np.sin(np.radians(angle)))
        np.testing.assert_allclose(steps, steps[0], rtol=1e-9)


def even(space):
    """Return coefficients that are even in y and not in x."""
    net = np.random.default_rng(2).uniform(-0.5, 0.5, (space.kv_u.dim, space.kv_v.dim))
    return (net + net[:, ::-1]).ravel() / 2


@pytest.mark.parametrize("changes", [{}, {"source.half_angle": 50.0}, POINT], ids=["wide", "narrow", "point"])
@pytest.mark.parametrize("sag", [None, even], ids=["conic", "even in y"])
def test_a_lens_that_is_even_in_y_has_even_fans(tmp_path, backend, sag, changes):
    made = loaded(tmp_path, changes, sag)
    for paths in fans(OpticalSystem(made.problem), made.lens, backend).values():
        assert [p.fate for p in paths] == [p.fate for p in paths[::-1]]
        for one, other in zip(paths, paths[::-1]):
            np.testing.assert_allclose(other.points * [1, -1, 1], one.points, rtol=1e-9, atol=1e-8)


def test_a_rays_landing_point_is_that_of_the_sequential_trace(tmp_path, backend):
    """Paths of four points went front, rear, target; the middle rays of a narrow fan all do."""
    made = loaded(tmp_path, {"source.half_angle": 40.0}, lambda space: rough(space, 0.3))
    for paths in fans(OpticalSystem(made.problem), made.lens, backend).values():
        first = np.array([p.points[1] - p.points[0] for p in paths])
        direction = first / np.linalg.norm(first, axis=1, keepdims=True)
        rays = Rays(np.array([p.points[0] for p in paths]).T, direction.T, np.ones(len(paths)))
        _, landing = Tracer(backend, made.lens, rays, made.problem.target_z).trace(
            [made.lens.rear.sag.coefficients]
        )
        assert [len(p.points) for p in paths] == [4] * FAN
        expected = np.stack([landing.x.numpy(), landing.y.numpy()], axis=1)
        np.testing.assert_allclose([p.points[-1][:2] for p in paths], expected, rtol=0, atol=1e-6)
