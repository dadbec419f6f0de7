"""A kind of source is looked up once, where a problem becomes its source; all else asks the source."""

import ast
import re
from dataclasses import dataclass, fields

import numpy as np
import pytest

from optics.analysis import sequential
from optics.external.random_rays import random_rays
from optics.problem import Source, load_problem
from optics.problem.schema import SOURCES as KEYS
from optics.runtime import load_backend
from optics.sources import LightSource, PointSource, Rays
from optics.sources.file_sources import FileSource
from optics.system import OpticalSystem, advice, source_of
from optics.system.source import SOURCES
from optics.tolerancing import tolerances_of
from tests.optics.cases import write_problem
from tests.source_tree import PACKAGE_FILES, name, tree
from thbcad.certified import Stack, supports_of

SOURCE = re.compile(r"\b(source|source\.settings|own|keys)\.kind")
ANSWERS = ("collimated", "extended", "diverging", "from_afar", "from_file", "scalable", "glowing", "axial")
SUN = {"source.divergence_profile": "sun"}
LAMP = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5]}
POINT = {"source.kind": "point"}
RAYS = {"source.kind": "rays", "source.file": "no.tm25ray"}
LUMINAIRE = {"source.kind": "luminaire", "source.file": "no.ies", "source.flux": 2.0}


@dataclass(frozen=True, eq=False, kw_only=True)
class Torch(FileSource):
    """A kind that nobody knows: a cone of rays from a small square, whatever its file holds."""

    def sample(self):
        x, y = (a.ravel() * 0.02 for a in np.mgrid[-8:9, -8:9])
        direction = np.stack([x, y, np.ones_like(x)]) / np.sqrt(1 + x * x + y * y)
        start = np.stack([x, y, np.full_like(x, -self.distance)])
        return Rays(start, direction, np.full(x.size, self.flux / x.size))

    def parts(self, counts, fresh=None, most=1000, aperture=None, centre=(0.0, 0.0)):
        yield from self.sample().slices(most)

    def starts(self):
        return self.sample().origin

    def envelope(self):
        corners = self.starts()[:2].T
        return Stack(np.array([-self.distance]), supports_of(corners)[None]), 15.0


def test_each_kind_of_the_file_has_a_class_that_takes_keys_of_the_file():
    assert list(SOURCES) == list(KEYS)
    keys = {f.name for f in fields(Source)}
    for made in SOURCES.values():
        assert {f.name for f in fields(made)} - keys <= {"shape", "picture", "aperture"}


def test_no_kind_of_source_is_compared_in_the_product():
    compared = [
        (name(path), ast.unparse(node))
        for path in PACKAGE_FILES
        for node in ast.walk(tree(path))
        if isinstance(node, ast.Compare) and SOURCE.search(ast.unparse(node))
    ]
    assert compared == []


@pytest.mark.parametrize(
    ("changes", "answers"),
    [
        ({}, {"collimated", "from_afar", "scalable"}),
        (SUN, {"extended", "diverging", "from_afar", "scalable"}),
        (LAMP, {"extended", "scalable", "glowing"}),
        (POINT, {"axial"}),
        (RAYS, {"extended", "from_file"}),
        (LUMINAIRE, {"extended", "from_file", "glowing"}),
    ],
    ids=["beam", "sun", "lambertian", "point", "rays", "luminaire"],
)
def test_a_source_answers_before_its_file_is_read(tmp_path, changes, answers):
    """There are no such files."""
    source = source_of(load_problem(write_problem(tmp_path, changes)))
    assert {a for a in ANSWERS if getattr(source, a)} == answers


def test_a_source_of_a_new_kind_is_all_that_its_class_says(tmp_path):
    """Traced, judged and held against tolerances without a word about it elsewhere."""
    place = {"shift": (0.0, 0.0), "tilt": (0.0, 0.0, 0.0), "turn": (0.0, 0.0, 0.0)}
    torch = Torch(flux=2.0, distance=20.0, file="none", **place)
    system = OpticalSystem(load_problem(write_problem(tmp_path, {"lens.front.radius": 100.0})))
    system.__dict__["sources"] = (torch,)
    image, fates, _ = sequential(system, system.lens, load_backend("double"), 17)
    assert sum(vars(fates).values()) == pytest.approx(2.0, rel=1e-12)
    assert image.any()
    point = torch.without_extent()
    assert isinstance(point, PointSource)
    assert point.distance == pytest.approx(21.0, rel=1e-12)  # its rays meet 1 mm behind the square
    assert torch.cone == pytest.approx(np.degrees(np.arctan(0.16 * np.sqrt(2))), rel=0.1)
    names = {tolerance.name for tolerance in tolerances_of(system)}
    assert "source.defocus" in names
    assert "source.size" not in names
    assert not any("luminaire" in sentence for sentence in advice(system))
    with pytest.raises(TypeError, match="Torch"):
        next(random_rays(torch, 0.0, 4, 1, 4))


def test_an_extended_source_has_no_cells(tmp_path):
    source: LightSource = source_of(load_problem(write_problem(tmp_path, LAMP)))
    with pytest.raises(TypeError, match="has no cells"):
        source.cells((4, 4))
