"""A kind of source is looked up once, where a problem becomes its source; all else asks the source."""

import ast
import re
from dataclasses import fields

import pytest

from optics.scene.problem import Source, load_problem
from optics.scene.sources import LightSource
from optics.scene.system import source_of
from optics.scene.system.source import SOURCES
from tests.optics.cases import write_problem
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
