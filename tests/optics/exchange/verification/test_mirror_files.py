"""The STEP file of a mirror names its face and its back, and all its checks find them."""

import pytest

from optics.exchange.verification import StepFile, export_step, text_and_occt_checks, verify
from optics.scene.problem import Problem
from optics.scene.system import System, designed_part
from tests.optics.cases import failing
from thbcad.cad.exchange import read_step

MIRROR = {
    "kind": "mirror",
    "name": "M1",
    "tilt": (45, 0, 0),
    "thickness": 4,
    "face": {"half_width": (10, 15), "radius": -400.0, "freeform": {"max_level": 0, "z_freedom": 1.0}},
}


@pytest.fixture
def system():
    target = {"kind": "tophat", "position": (0, 60, 0), "tilt": (-90, 0, 0), "half_width": (10, 10)}
    beam = {"kind": "collimated", "half_width": (8, 8)}
    return System(Problem(source=beam, element=[MIRROR], target=target | {"pixels": (8, 8)}))


def test_its_faces_are_face_and_back(system, tmp_path, backend):
    path = tmp_path / "lens.step"
    export_step(designed_part(system), "AP242", path)
    assert read_step(path).face_names[:2] == ("face", "back")
    assert "refractive" not in path.read_text()
    file = StepFile(path)
    assert failing(text_and_occt_checks(system, file, backend)) == []
    assert failing(verify(system, file, backend)) == []
