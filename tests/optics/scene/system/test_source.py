"""A source is looked up once, where a problem becomes its source, and turned as `tilt` and `turn` say."""

import ast
import re
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from optics.base.runtime import UserError
from optics.scene.problem import Source, load_problem
from optics.scene.sources import LightSource, RayFileSource
from optics.scene.system import source_of
from optics.scene.system.source import SOURCES
from tests.optics.cases import SMALL, write_problem
from tests.optics.scene.problem.cases import load_text, load_values
from tests.source_tree import PACKAGE_FILES, name, text, tree

SOURCE = re.compile(r"\b(source|source\.settings|own|keys)\.kind")
ANSWERS = ("collimated", "extended", "diverging", "from_afar", "by_rays", "scalable", "emitter", "axial")
SUN = {"source.divergence_profile": "sun"}
LAMP = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5]}
POINT = {"source.kind": "point"}
RAYS = {"source.kind": "rays", "source.file": "no.tm25ray"}
LUMINAIRE = {"source.kind": "luminaire", "source.file": "no.ies", "source.flux": 2.0}


def test_each_kind_of_the_file_has_a_class_that_takes_keys_of_the_file():
    keys = {f.name: f.metadata for f in fields(Source)}
    assert tuple(SOURCES) == keys["kind"]["choices"]
    for made in SOURCES.values():
        assert {f.name for f in fields(made)} - set(keys) <= {"shape", "picture", "aperture"}


def test_no_kind_of_source_is_compared_in_the_product():
    compared = [
        (name(path), ast.unparse(node))
        for path in PACKAGE_FILES
        if SOURCE.search(text(path))
        for node in ast.walk(tree(path))
        if isinstance(node, ast.Compare) and SOURCE.search(ast.unparse(node))
    ]
    assert compared == []


@pytest.mark.parametrize(
    ("changes", "answers"),
    [
        ({}, {"collimated", "from_afar", "scalable"}),
        (SUN, {"extended", "diverging", "from_afar", "scalable"}),
        (LAMP, {"extended", "scalable", "emitter"}),
        (POINT, {"axial"}),
        (RAYS, {"extended", "by_rays"}),
        (LUMINAIRE, {"extended", "by_rays", "emitter"}),
    ],
    ids=["beam", "sun", "lambertian", "point", "rays", "luminaire"],
)
def test_a_source_answers_before_its_file_is_read(tmp_path, changes, answers):
    """There are no such files."""
    source = source_of(load_problem(write_problem(tmp_path, changes)))
    assert {a for a in ANSWERS if getattr(source, a)} == answers


def test_an_extended_source_has_no_cells(tmp_path):
    source: LightSource = source_of(load_problem(write_problem(tmp_path, LAMP)))
    with pytest.raises(TypeError, match="has no cells"):
        source.cells((4, 4))


ANGLES = st.tuples(*[st.floats(-360, 360)] * 3)
SMALL_ANGLES = st.tuples(*[st.floats(-1, 1)] * 3)
OF_FILE = {"source.kind": "rays", "source.file": "lamp.tm25ray"}


def rotation(**angles):
    place = {"shift": (0.0, 0.0), "tilt": (0.0, 0.0, 0.0), "turn": (0.0, 0.0, 0.0)} | angles
    return RayFileSource(flux=1.0, distance=2.0, file="lamp.tm25ray", **place).pose.rotation


def turned_about(axis, degrees):
    return Rotation.from_rotvec(np.radians(degrees) * np.asarray(axis)).as_matrix()


@given(tilt=ANGLES)
def test_a_tilt_is_scipys_rotation_by_euler_angles_about_own_axes(tilt):
    wanted = Rotation.from_euler("XYZ", tilt, degrees=True).as_matrix()
    np.testing.assert_allclose(rotation(tilt=tilt), wanted, rtol=0, atol=1e-15)


@given(tilt=ANGLES)
def test_a_tilt_turns_right_handed_about_axes_that_turn_with_the_light(tilt):
    """Each step is about an axis of the light where the steps before have brought it."""
    frame = np.eye(3)
    for k, angle in enumerate(tilt):
        frame = turned_about(frame[:, k], angle) @ frame
    np.testing.assert_allclose(rotation(tilt=tilt), frame, rtol=0, atol=1e-14)


@given(turn=ANGLES)
def test_a_turn_keeps_its_meaning_about_axes_that_stay(turn):
    frame = np.eye(3)
    for axis, angle in zip(np.eye(3), turn):
        frame = turned_about(axis, angle) @ frame
    np.testing.assert_allclose(rotation(turn=turn), frame, rtol=0, atol=1e-14)


@given(angles=SMALL_ANGLES)
def test_small_tilts_and_turns_agree_to_first_order(angles):
    """They differ by the commutators of the three steps: at most ab + ac + bc, and as much again of higher
    orders for a degree."""
    a, b, c = np.abs(np.radians(angles))
    difference = rotation(tilt=angles) @ rotation(turn=angles).T
    assert Rotation.from_matrix(difference).magnitude() <= 1.1 * (a * b + a * c + b * c) + 1e-14


def test_large_tilts_and_turns_differ():
    """Upright light, a quarter about x, then one about z: its own z leaves the light alone, the scene's does
    not."""
    z, quarters = np.array([0.0, 0.0, 1.0]), (90.0, 0.0, 90.0)
    np.testing.assert_allclose(rotation(tilt=quarters) @ z, [0, -1, 0], atol=1e-15)
    np.testing.assert_allclose(rotation(turn=quarters) @ z, [1, 0, 0], atol=1e-15)


def test_one_angle_is_the_same_in_both_ways():
    for k in range(3):
        angles = tuple(37.0 * (k == i) for i in range(3))
        np.testing.assert_array_equal(rotation(tilt=angles), rotation(turn=angles))


def test_both_at_once_are_refused(tmp_path):
    turned = SMALL | OF_FILE | {"source.turn": [0.0, 20.0, 0.0]}
    with pytest.raises(UserError, match=r"source\.tilt .* and source\.turn .* say one rotation twice; leave"):
        load_values(tmp_path, turned | {"source.tilt": [1.0, 0.0, 0.0]})
    assert load_values(tmp_path, turned | {"source.tilt": [0, 0, 0]}).source.turn == (0.0, 20.0, 0.0)


@pytest.mark.parametrize("key", ["tilt", "turn"])
def test_the_resolved_file_says_what_was_said(tmp_path, key):
    problem = load_values(tmp_path, SMALL | OF_FILE | {f"source.{key}": [10.0, 20.0, 30.0]})
    assert f"{key} = [10.0, 20.0, 30.0]\n" in problem.to_toml()
    assert load_text(tmp_path, problem.to_toml()) == problem


@pytest.mark.parametrize("key", ["shift", "turn"])
@pytest.mark.parametrize("kind", ["collimated", "lambertian", "point"])
def test_a_place_that_would_be_passed_over_is_refused(tmp_path, kind, key):
    place = [1.0] * (2 if key == "shift" else 3)
    other = {"shift": "position", "turn": "tilt"}[key]
    width = [0.0, 0.0] if kind == "point" else [1.0, 1.0]
    sentence = rf'source\.{key} has no effect with source\.kind = "{kind}"; .* set source\.{other},'
    with pytest.raises(UserError, match=sentence):
        load_values(
            tmp_path, SMALL | {"source.kind": kind, "source.half_width": width, f"source.{key}": place}
        )
