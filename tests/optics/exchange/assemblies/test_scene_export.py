"""The scene of a row of elements as an assembly: parts, places and numbers are those of the system."""

import re

import numpy as np
import pytest

from optics.exchange.assemblies import export_scene, scene_checks, scene_text_check
from optics.exchange.verification import StepFile, other_part_checks
from optics.scene.system import System, other_parts, scene_parts
from tests.optics.cases import failing, small_system
from tests.optics.scene.problem.cases import ROW, load_text
from thbcad.cad.exchange import read_scene, step_bytes

CURVED = {"target.surface": "cylinder", "target.radius": 30.0}


@pytest.fixture
def row(tmp_path):
    return System(load_text(tmp_path, ROW))


def test_parts_bear_the_names_of_the_elements_in_their_order(row):
    parts = scene_parts(row)
    assert [(part.name, part.product.name) for part in parts] == [("L1", "L1"), ("M1", "M1")]
    assert parts[0].pose.shift.tolist() == [0.0, 0.0, -20.0]


@pytest.mark.parametrize("changes", [{}, CURVED])
def test_source_and_screen_stand_in_their_places_as_thin_parts(row, tmp_path, changes):
    system, path = System(row.problem.with_(**changes)), tmp_path / "staged.step"
    assert failing(export_scene(system, path, staged=True)) == []
    source, *_, screen = read_scene(path)
    assert (source.name, screen.name) == ("source", "screen")
    assert source.pose.shift.tolist() == [0.0, 0.0, -30.1]  # 0.1 mm thick before the source plane
    assert np.abs(screen.pose.rotation - system.target.receiver.pose.rotation).max() <= 1e-15


def test_each_of_several_sources_is_a_part_at_its_place(row, tmp_path):
    array = {"columns": 2, "rows": 1, "pitch": (9.0, 9.0)}
    place = {"source.distance": 2.0, "source.position": (3.0, 0.0, -45.0)}
    of_four = row.problem.with_(**{"source.array": array}, **place)
    system, path = System(of_four), tmp_path / "staged.step"
    assert failing(export_scene(system, path, staged=True)) == []
    places = {part.name: part.pose.shift.tolist() for part in read_scene(path) if "source" in part.name}
    assert places == {"source 1": [-1.5, 0.0, -45.1], "source 2": [7.5, 0.0, -45.1]}


def test_another_place_and_another_shape_are_told(row, tmp_path):
    path = tmp_path / "scene.step"
    assert failing(export_scene(row, path)) == []
    lens = row.problem.with_(**{"element.L1.position": (0, 0, -20 - 2e-11), "element.L1.front.radius": 99.0})
    other = System(lens)
    assert failing(scene_checks(other.with_lens(row.base), path)) == [
        "scene: distance of L1 from its place",
        "scene: numbers of L1 that differ from those in memory",
    ]
    renamed = System(row.problem.with_(**{"element.M1.name": "M2"}))
    assert failing(scene_checks(renamed.with_lens(row.base), path)) == [
        "scene: parts that are not those named"
    ]


def test_a_file_that_was_cut_does_not_reach_occt(row, tmp_path):
    path = tmp_path / "scene.step"
    export_scene(row, path)
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(ValueError, match="is not a whole STEP file"):
        scene_checks(row, path)


def test_a_scene_that_is_not_that_of_the_files_of_its_elements_is_told(row, tmp_path):
    """OCCT closes the gap of an edge that runs backwards; splines and places are those in memory."""
    parts, path = scene_parts(row), tmp_path / "scene.step"
    files = {part.name: tmp_path / part.file for part in parts}
    for part in parts:
        files[part.name].write_bytes(step_bytes(part.made, part.product))
    assert failing(export_scene(row, path, files=files)) == []
    assert scene_text_check(row, path, files).ok
    whole = path.read_text("ascii")
    changed = re.sub(r"(ORIENTED_EDGE\('',\*,\*,#\d+,)\.T\.", r"\1.F.", whole, count=1)
    path.write_text(changed, "ascii")
    assert failing(scene_checks(row, path)) == []
    assert scene_text_check(row, path, files).value == 1


def test_a_fixed_element_whose_file_names_another_glass_is_told(row, tmp_path):
    part, path = other_parts(row)[0], tmp_path / "M1.step"
    text = step_bytes(part.made, part.product).decode("ascii")
    path.write_text(text, "ascii")
    assert failing(other_part_checks(part, StepFile(path), row.problem)) == []
    changed = text.replace("refractive index 1.5", "refractive index 1.7")
    assert changed != text
    path.write_text(changed, "ascii")
    (told,) = failing(other_part_checks(part, StepFile(path), row.problem))
    assert told.startswith(f"{part.name}: text of the file: words that are not those of the problem")


@pytest.mark.every(2)
@pytest.mark.parametrize("rows", [1, 2])
def test_every_lens_of_a_plate_has_its_source_before_it(tmp_path, rows):
    plate = {"lens.array.columns": 3, "lens.array.rows": rows, "lens.array.pitch": 25.0}
    system = small_system(tmp_path, plate | {"lens.thickness": 8.0})
    path = tmp_path / "staged.step"
    assert failing(export_scene(system, path, staged=True)) == []
    *parts, screen = read_scene(path)
    sources = [part.pose.shift[:2].tolist() for part in parts if part.name.startswith("source ")]
    assert sources == system.made.places.tolist()
    assert screen.pose.shift[:2].tolist() == np.mean(sources, axis=0).tolist()
