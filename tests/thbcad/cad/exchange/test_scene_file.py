"""An assembly holds the parts' own numbers, and other programs read names and places back."""

import json
import os
import re
import shutil
import subprocess
from dataclasses import replace

import build123d as bd
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.thbcad.cases import LENSES
from thbcad.cad.exchange import scene_step, sheet_part, step_bytes
from thbcad.cad.exchange.scene_file import read_scene
from thbcad.cad.exchange.solid_file import SolidState, conic_faces, spline_faces
from thbcad.cad.shapes import lens_part
from thbcad.lens import Product
from thbcad.poses import Pose
from thbcad.splines import BSplineSurface, KnotVector

PLACED = 1e-11  # mm: within a metre of the origin a coordinate is rounded by 1e-13
ROUNDED = 1e-14  # of a rotation, through a quaternion
WHOLE = Product("Zeile mit 'ü'", author="somebody")
POSES = {
    "plano": Pose.at(),
    "freeform": Pose.tilted((1.5, -20.0, 900.0), (45.0, 0.0, 0.0)),
    "sphere": Pose.tilted((-333.3, 0.1, 7.0), (-170.0, 33.0, 91.0)),
}
BODIES = [(LENSES[name], Product(name, material="glass"), pose) for name, pose in POSES.items()]
FREECAD = """
import json, os, Part
shape = Part.Shape()
shape.read(os.environ["STEP_FILE"])
places = [[list(part.Placement.Base), list(part.Placement.Rotation.Q)] for part in shape.SubShapes]
print("\\n" + json.dumps(places))
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.step"
    path.write_bytes(scene_step(BODIES, WHOLE))
    return path


def entities(text):
    """Return the entities of a file without their numbers."""
    data = text.decode("ascii").partition("DATA;\n")[2]
    return re.sub(r"'(?:[^']|'')*'|#\d+", lambda m: "#" if m[0][0] == "#" else m[0], data).split(";\n")


def test_every_part_keeps_each_entity_of_its_own_file(scene):
    held = entities(scene.read_bytes())
    start = 0
    for lens, product, _ in BODIES:
        own = entities(step_bytes(lens, product))[:-3]  # without what ends a file
        assert held[start : start + len(own)] == own
        start += len(own)


def test_the_same_scene_gives_the_same_bytes(scene):
    assert scene_step(BODIES, WHOLE) == scene.read_bytes()


def test_a_body_may_be_its_file_under_another_name(scene):
    files = [
        (step_bytes(b, replace(product, name="it's 'ü' #1")), product, pose) for b, product, pose in BODIES
    ]
    assert entities(scene_step(files, WHOLE)) == entities(scene.read_bytes())


def test_numbers_are_those_of_one_entity_each_and_texts_keep_theirs():
    text = scene_step([(b, Product("it's #12"), pose) for b, _, pose in BODIES], WHOLE).decode("ascii")
    own = re.findall(r"^#(\d+)=", text, re.MULTILINE)
    said = re.findall(r"'(?:[^']|'')*'|#(\d+)", text)
    assert len(set(own)) == len(own)
    assert set(said) - {""} == set(own)
    assert text.count("PRODUCT('it''s #12','it''s #12'") == len(BODIES)


def test_occt_reads_whole_solids_with_the_numbers_in_memory(scene):
    for part, (lens, product, pose) in zip(read_scene(scene), BODIES, strict=True):
        assert part.name == product.name
        assert np.abs(part.pose.shift - pose.shift).max() <= PLACED
        state = SolidState(part.shape)
        assert (state.solids, state.free_edges, state.closed, state.valid) == (1, 0, True, True)
        own = lens_part(lens).solid
        assert spline_faces(part.shape) == spline_faces(own)
        for read, made in zip(conic_faces(part.shape), conic_faces(own), strict=True):
            assert read.numbers.tolist() == made.numbers.tolist()


def test_build123d_reads_names_and_places(scene):
    whole = bd.import_step(scene)
    assert [part.label for part in whole.children] == [*POSES]
    for part, pose in zip(whole.children, POSES.values()):
        motion = part.location.wrapped.Transformation()
        rows = np.array([[motion.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
        far = np.array([100.0, -100.0, 100.0])
        assert np.abs(rows[:, :3] @ far + rows[:, 3] - pose.points(far)).max() <= PLACED


@pytest.mark.skipif(shutil.which("freecadcmd") is None, reason="FreeCAD is not installed")
def test_freecad_reads_places(scene, tmp_path):
    script = tmp_path / "places.py"
    script.write_text(FREECAD)
    settings = os.environ | {"STEP_FILE": str(scene), "HOME": str(tmp_path)}
    told = subprocess.run(["freecadcmd", script], env=settings, capture_output=True, text=True, timeout=300)
    places = json.loads(told.stdout.strip().splitlines()[-1])
    for (base, quaternion), pose in zip(places, POSES.values(), strict=True):
        assert np.abs(np.array(base) - pose.shift).max() <= PLACED
        assert np.abs(Rotation.from_quat(quaternion).as_matrix() - pose.rotation).max() <= ROUNDED


def test_a_sheet_is_a_closed_solid(tmp_path):
    kv = KnotVector.uniform(3, 2, -10.0, 10.0)
    x, y = np.meshgrid(kv.greville(), kv.greville(), indexing="ij")
    sheet = sheet_part(BSplineSurface(kv, kv, np.stack([x, y, 0.01 * x * y], axis=-1)), 0.1)
    state = SolidState(sheet.solid)
    assert (state.solids, state.free_edges, state.closed, state.valid) == (1, 0, True, True)
    assert state.volume == pytest.approx(20.0 * 20.0 * 0.1, rel=1e-9)  # what a shift along z sweeps
