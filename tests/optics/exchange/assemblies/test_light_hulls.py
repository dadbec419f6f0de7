"""The hulls of the light hold all rays of every kind of source; rays are stopped by what is in their way."""

import numpy as np
import pytest

from optics.exchange.assemblies import light_samples
from optics.exchange.assemblies.blocked_paths import Obstacles, within_outline
from optics.exchange.assemblies.light_hulls import light_hulls
from optics.exchange.assemblies.light_samples import edge_triangles, sampled_light, straight_paths
from optics.scene.problem import load_problem
from optics.scene.system import solvable_system
from tests.cases import ROOT
from tests.thbcad.cad.parts.cases import LENSES
from tests.thbcad.drawings.cases import WIDER, outlined

SOURCES = {
    "parallel": ("tophat_square", {}),
    "round beam": ("tophat_circle", {}),
    "sun": ("tophat_square", {"source.divergence_profile": "sun"}),
    "gaussian": ("tophat_square", {"source.divergence": 1.0, "source.divergence_profile": "gaussian"}),
    "point": ("point", {"target.kind": "tophat", "target.image": ""}),
    "lambertian": ("extended", {}),
    "curved front": ("lamp", {}),
    "far field": ("far_field", {}),
    "tilted": ("tophat_square", {"target.tilt": (50.0, 20.0, 0.0)}),
    "near and aside": (
        "tophat_square",
        {"target.distance": None, "target.position": (0.0, -10.0, 110.0), "target.tilt": (50.0, 0.0, 0.0)}
        | {"target.half_width": (60.0, 60.0)},
    ),
    "column": ("tophat_square", {"target.surface": "cylinder", "target.radius": 80.0}),
    "bowl": ("tophat_square", {"target.surface": "sphere", "target.radius": -120.0}),
    "tilted far field": ("far_field", {"target.tilt": (10.0, 5.0, 0.0)}),
}
ROUNDING = 1e-9  # mm


@pytest.fixture
def few_rays(monkeypatch):
    monkeypatch.setattr(light_samples, "RAYS", 1 << 13)
    monkeypatch.setattr(light_samples, "SETS", 2)


@pytest.mark.every(5)
@pytest.mark.parametrize("name", SOURCES)
def test_all_light_stays_in_its_hulls(name, few_rays):
    example, changes = SOURCES[name]
    coarse = {"target.pixels": (32, 32), "run.threads": 1}
    system = solvable_system(load_problem(ROOT / f"examples/{example}.toml", {**changes, **coarse}))
    heights = -12.0, 80.0
    hulls = light_hulls(system.base, system, heights)
    count = 0
    for paths in sampled_light(system, hulls.target, heights):
        ends = {
            "source to front": (paths.start, paths.front),
            "front to rear": (paths.front, paths.rear),
            "rear to target": (paths.rear, paths.end),
        }
        for segment, (start, stop) in ends.items():
            region = hulls.regions[segment].shrunk(-ROUNDING)
            for share in (0.0, 0.3, 1.0):
                points = start + share * (stop - start)
                inside = (points[:, 2] > heights[0]) & (points[:, 2] < heights[1])
                assert region.holds(points[inside]).all()
        count += len(paths.flux)
    assert count > 1000


ROUND = outlined(WIDER, (1, 1))


@pytest.mark.slow
def test_all_straight_paths_stay_in_the_hull_of_any_light(few_rays):
    for lens in (*LENSES.values(), ROUND, outlined(WIDER, (0.3, 0.5))):
        region = light_hulls(lens, None, (-5.0, 20.0)).regions["front to rear"].shrunk(-ROUNDING)
        for paths in straight_paths(lens):
            assert region.holds(paths.front).all()
            assert region.holds(paths.rear).all()


def test_paths_are_stopped_by_a_disk_as_often_as_it_is_large():
    angles = np.linspace(0, 2 * np.pi, 201)
    rim = 0.3 * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    disk = Obstacles(np.stack([0 * rim[1:], rim[:-1], rim[1:]], axis=1) + np.array([0.2, -0.1, 2.0]))
    x, y = (a.ravel() for a in np.meshgrid(*((np.arange(400) + 0.5) / 200 - 1,) * 2))
    start = np.column_stack([x, y, 0 * x])
    met = disk.stop(start, start + np.array([0, 0, 5.0]))
    assert np.array_equal(met, within_outline(start[:, :2], _segments(rim[:, :2] + np.array([0.2, -0.1]))))
    assert met.mean() == pytest.approx(np.pi * 0.3**2 / 4, rel=2e-3)  # a grid of 400 x 400
    assert not disk.stop(start, start + np.array([0, 0, 2.0])).any()  # they end on it
    assert not Obstacles(np.empty((0, 3, 3))).stop(start, start + 1).any()


def _segments(loop):
    return np.stack([loop[:-1], loop[1:]], axis=1)


def test_edges_of_one_size_are_met_by_no_path():
    assert not len(edge_triangles(LENSES["round"]))
    assert len(edge_triangles(LENSES["flat, smaller"]))


def test_the_light_of_a_lens_with_an_outline_keeps_within_it(few_rays):
    """Its figures lie between 64 tangents, 1 / cos(pi / 64) - 1 = 0.0012 beyond an ellipse at most."""
    hulls = light_hulls(ROUND, None, (-5.0, 20.0))
    turn = np.linspace(0, 2 * np.pi, 500)
    for name, surface in (("front", ROUND.front), ("rear", ROUND.rear)):
        ring = np.column_stack([np.cos(turn), np.sin(turn)]) * surface.half_width
        inside, beyond = (np.column_stack([k * ring, 0 * turn]) for k in (0.9999, 1.01))
        assert hulls.prisms[name].holds(inside).all()
        assert not hulls.prisms[name].holds(beyond).any()
    for paths in straight_paths(ROUND):
        assert ROUND.front.outline.contains(*paths.front[:, :2].T, slack=1e-12).all()
        assert ROUND.rear.outline.contains(*paths.rear[:, :2].T, slack=1e-12).all()


def test_the_wall_of_an_outline_runs_from_rim_to_rim():
    corners = edge_triangles(ROUND).reshape(-1, 3)
    rims = [surface.outline.gauge(*corners[:, :2].T) for surface in (ROUND.front, ROUND.rear)]
    assert np.abs(np.array(rims) - 1).min(axis=0).max() < 1e-12
    assert edge_triangles(ROUND).shape[0] > 1000
