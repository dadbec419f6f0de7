"""Lenses with their mounts as solids and as meshes."""

from itertools import pairwise
from math import pi, tan

import numpy as np
import pytest
import trimesh
from OCP.BRep import BRep_Tool

from tests.thbcad.mounts.cases import CONCAVE, FLAT, FLAT_REAR, PLAIN, ROUND, SQUARE, changed
from thbcad.cad.exchange import SolidState, part_mesh, solid_volume
from thbcad.cad.parts.mount_solids import mounted_part
from thbcad.cad.parts.numbers_of_surfaces import surface_numbers
from thbcad.cad.parts.search import placed_lens
from thbcad.cad.shapes import lens_part
from thbcad.mounts import mount_of

MOUNTS = {
    "square": (FLAT, SQUARE),
    "round": (FLAT, ROUND),
    "stepped": (FLAT, changed(ROUND, flange__seat=1.0)),
    "frame": (CONCAVE, changed(PLAIN, flange__thickness=3.05)),
    "rear": (FLAT_REAR, changed(ROUND, flange__seat="rear")),
}


@pytest.mark.every(3)
@pytest.mark.parametrize("name", MOUNTS)
def test_a_mounted_lens_is_one_closed_solid_with_its_own_front_and_rear(name):
    lens, table = MOUNTS[name]
    part = mounted_part(lens, mount_of(table))
    state = SolidState(part.solid)
    assert (state.solids, state.free_edges) == (1, 0)
    assert state.valid
    placed = placed_lens(part, lens)
    assert not placed.moved
    own = dict(zip(lens_part(lens).names, lens_part(lens).faces))
    for word, face in placed.faces.items():
        numbers = surface_numbers(BRep_Tool.Surface_s(face))
        assert numbers.differing(surface_numbers(placed.surfaces[word])) == 0
        assert SolidState(face).area == pytest.approx(SolidState(own[word]).area, rel=1e-9)
    words = {"holes": "hole 1", "pins": "pin 1", "bosses": "boss 1", "gate": "gate", "flange": "flange"}
    wanted = {"front", "rear", *(words[key] for key in table)}
    assert wanted <= set(part.names)


def test_volumes_of_what_is_added_are_those_of_cylinders_and_cones():
    whole, plain = (
        solid_volume(mounted_part(FLAT, mount_of(t)).solid, 1e-9)
        for t in (changed(PLAIN, flange__size=[60, 60]), PLAIN)
    )
    assert whole - plain == pytest.approx(60 * 60 - 30 * 26, rel=1e-9)

    def added(**table):
        body = mounted_part(FLAT, mount_of({**PLAIN, **table, "wall": 0.1}))
        return solid_volume(body.solid, 1e-9) - plain

    at = [[12.5, 0.0]]
    assert added(holes=[{"at": at, "diameter": 2}]) == pytest.approx(-pi, rel=1e-6)
    sink = tan(pi / 4) * 0.5  # of a countersink of 3 mm on 2 mm at 90 degrees
    cone = pi * sink / 3 * (1.5**2 + 1.5 + 1)
    drilled = added(holes=[{"at": at, "diameter": 2, "countersink": 3}])
    assert drilled == pytest.approx(-(cone + pi * (1 - sink)), rel=1e-6)
    assert added(pins=[{"at": at, "diameter": 2, "length": 3}]) == pytest.approx(3 * pi, rel=1e-6)
    assert added(bosses=[{"at": at, "diameter": 2, "bore": 1, "length": 3}]) == pytest.approx(
        3 * pi * (1 - 0.25), rel=1e-6
    )
    assert added(gate={"width": 4, "length": 5, "thickness": 0.5}) == pytest.approx(10, rel=1e-6)


@pytest.mark.parametrize("outline", ["rectangular", "round"])
def test_draft_and_chamfer_give_the_prismatoid_of_their_sections(outline):
    size = {"size": [40, 40]} if outline == "rectangular" else {"diameter": 40}
    flange = {"outline": outline, **size, "thickness": 2, "chamfer": 0.25, "draft": 10}
    square = {"flange": {**flange, "draft": 0, "chamfer": 0}}
    whole = solid_volume(mounted_part(FLAT, mount_of(square)).solid, 1e-9)
    body = solid_volume(mounted_part(FLAT, mount_of({"flange": flange})).solid, 1e-9)
    factor = 4 if outline == "rectangular" else pi
    sections = mount_of({"flange": flange}).flange.sections()
    volume = sum(
        (b[0] - a[0]) / 3 * factor * ((20 - a[1]) ** 2 + (20 - a[1]) * (20 - b[1]) + (20 - b[1]) ** 2)
        for a, b in pairwise(sections)
    )
    assert whole - body == pytest.approx(factor * 400 * 2 - volume, rel=1e-6)


@pytest.mark.every(3)
@pytest.mark.parametrize("name", ["square", "round", "frame"])
@pytest.mark.parametrize("single", [False, True])
def test_meshes_are_closed_and_keep_the_chord_error(name, single):
    lens, table = MOUNTS[name]
    part = mounted_part(lens, mount_of(table))
    mesh = part_mesh(part, 0.02, single)
    body = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    assert body.is_watertight
    assert body.is_winding_consistent
    assert mesh.chord <= 0.02
    assert abs(body.volume - solid_volume(part.solid, 1e-6)) <= 0.02 * body.area
    rear = mesh.vertices[mesh.triangles[mesh.faces == part.names.index("rear")]].mean(axis=1)
    off = rear[:, 2] - lens.thickness - lens.rear(rear[:, 0], rear[:, 1])
    assert np.abs(off).max() <= 0.02  # heights of a surface that is nearly flat
