"""Plates as solids: closed, of the closed form's volume, and every lens with the numbers of the first."""

import build123d
import numpy as np
import pytest

from tests.thbcad.cad.shapes.cases import CASES, assert_whole
from thbcad.cad.exchange import read_step, step_bytes
from thbcad.io import parse_brep, volume
from thbcad.moulds import FACES, Plate, named_on_plate

LENSES = {
    "upright": (CASES["round"][0], (21.3, 17.1)),
    "front smaller": (CASES["front smaller"][0], (15.7, 16.9)),
    "sphere": (CASES["sphere"][0], (10.1, 9.7)),
}


@pytest.fixture(scope="module", params=LENSES)
def written(request, tmp_path_factory):
    """(plate, path) of 2 x 3 lenses."""
    lens, pitch = LENSES[request.param]
    plate = Plate.of(lens, (2, 3), pitch)
    path = tmp_path_factory.mktemp("plate") / "lens.step"
    path.write_bytes(step_bytes(plate))
    return plate, path


@pytest.mark.every(3)
def test_a_plate_is_one_closed_solid_of_the_volume_in_closed_form(written):
    plate, path = written
    text, read = parse_brep(path), read_step(path)
    assert (text.unpaired, text.gaps) == (0, 0)
    assert_whole(read, plate.face_count)
    assert volume(text) == pytest.approx(plate.volume(), rel=1e-9)  # rims are fitted within 1e-9 mm
    other = build123d.import_step(str(path))
    assert (other.is_valid, other.volume) == (True, pytest.approx(plate.volume(), rel=1e-4))  # OCCT's default


@pytest.mark.every(3)
def test_every_lens_has_the_poles_of_the_first_at_its_place_bit_for_bit(written):
    plate, path = written
    faces = {face.name: face for face in parse_brep(path).faces}
    assert len(faces) == plate.face_count
    for number, (x, y) in enumerate(plate.places.tolist()):
        for own, name in zip(FACES, named_on_plate(FACES, number)):
            first, there = (_points(faces[word]) for word in (own, name))
            assert (there == np.add(first, (x, y, 0.0))).all()


def _points(face):
    """The poles of a spline, the point of a plane or the centre of a sphere."""
    if face.surface is not None:
        return face.surface.coefficients
    return next(rows for rows in (face.plane, face.sphere) if rows is not None)[0]
