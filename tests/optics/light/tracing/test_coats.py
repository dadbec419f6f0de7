"""Coated lenses: a share of the light in place of Fresnel's, in both traces and in the budget of flux."""

import numpy as np
import pytest

from optics.light.tracing import TargetArea, Tracer, trace_nonsequential
from optics.scene.sources import Rays
from tests.optics.cases import small_problem, small_system

COATED = {"lens.front.reflectance": 0.004, "lens.rear.reflectance": 0.25, "lens.rear.radius": 60.0}


@pytest.fixture
def coated(tmp_path):
    return small_system(tmp_path, COATED)


def test_a_coat_lets_its_share_through_where_light_is_not_reflected_totally(coated, backend):
    rays, path = coated.source.rays((31, 29)), coated.path
    tracer = Tracer(backend, path, rays)
    _, landing = tracer.trace()
    fates = tracer.fates(landing, (1e3, 1e3))
    assert fates.by_name["front_reflected"] == pytest.approx(0.004, rel=1e-12)
    assert fates.by_name["rear_reflected"] == pytest.approx(0.996 * 0.25, rel=1e-12)
    bare = Tracer(backend, path.without_coats(), rays).trace()[1].flux.numpy()
    assert (bare > 0.9 / bare.size).all()


def test_all_reflections_of_a_coated_plate_are_a_geometric_series(coated, backend):
    """T = (1 - R) (1 - S) / (1 - R S) passes a plate whose coats reflect R and S from both sides."""
    plate = coated.base.with_rear(coated.base.front)
    rays = Rays(np.array([[0.5], [0.3], [-20.0]]), np.array([[0.0], [0.0], [1.0]]), np.ones(1))
    area = TargetArea.of(coated.path, (1e3, 1e3))
    found = trace_nonsequential(backend, plate, rays, area, bounces=40, threshold=0.0)
    assert found.fates.onto == pytest.approx(0.996 * 0.75 / (1 - 0.004 * 0.25), rel=1e-12)


def test_a_coat_is_written_only_where_there_is_one(coated, tmp_path):
    bare = small_problem(tmp_path).lens
    assert "reflectance = 0.25" in coated.problem.to_toml()
    assert "reflectance" not in coated.problem.with_optic(front=bare.front, rear=bare.rear).to_toml()
