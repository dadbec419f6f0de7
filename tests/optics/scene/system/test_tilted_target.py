"""A target across which light falls at an angle is a receiver with another pose, and nothing else."""

import json

import pytest

from optics.interface.commands import main
from tests.optics.cases import write_problem

WALL = {
    "lens.rear.radius": float("inf"),
    "lens.rear.conic": 0.0,
    "lens.rear.freeform.spans": [7, 7],
    "lens.rear.freeform.z_freedom": 5.0,
    "lens.rear.freeform.max_level": 3,
    "optimizer.iterations": [40],
    "target.kind": "tophat",
    "target.image": "",
    "target.distance": 150.0,
    "target.half_width": [30.0, 30.0],
    "target.pixels": [64, 64],
}


@pytest.mark.slow
@pytest.mark.parametrize("distance", [150.0, float("inf")])
def test_a_tilted_target_is_lit_evenly_and_its_file_is_verified(tmp_path, distance):
    """By 35 degrees, or 8 for directions.  0 says that the independent trace of the file ends there too."""
    tilt = {"target.tilt": [35.0 if distance < 1e9 else 8.0, 0.0, 10.0]}
    far = {} if distance < 1e9 else {"target.half_width": [8.0, 8.0]}
    path = write_problem(tmp_path, WALL | {"target.distance": distance} | tilt | far)
    assert main(["design", str(path), "--out", str(tmp_path / "out")]) == 0
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["uniformity"]["min_over_mean"] > 0.9
    assert metrics["rel_l2"] < 0.05
