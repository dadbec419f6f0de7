"""Damage to a STEP file at a known place, and the surface of the file as OCCT evaluates it."""

import numpy as np
import pytest

from optics.interface.audit.damage import _real, move_control_point
from optics.interface.audit.step_surface import rear_deviation
from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface, write_step
from thbcad.io import parse_brep

FLAT = FreeformSurface((10.0, 10.0))


@pytest.fixture(scope="module")
def lens():
    kv = KnotVector.uniform(degree=3, spans=8, start=-10, stop=10)
    space = THBSpace(kv, kv)
    heights = 0.05 * np.sin(np.arange(space.dim))
    rear = FreeformSurface((10.0, 10.0), Conic(60.0, -1.0), THBSurface(space, heights))
    return Lens(FLAT, rear, thickness=5.0, index=1.5)


@pytest.fixture
def path(lens, tmp_path):
    write_step(lens, tmp_path / "lens.step")
    return tmp_path / "lens.step"


def numbers(path):
    return [face.surface.coefficients for face in parse_brep(path).faces if face.surface is not None]


def test_one_coordinate_of_one_control_point_is_moved(path):
    before = numbers(path)
    damage = move_control_point(path, 1e-3)
    changed = [(b, a) for b, a in zip(before, numbers(path)) if (a != b).any()]
    ((old, new),) = changed
    places = np.argwhere(old != new)
    assert places.tolist() == [[damage.row, damage.column, 2]]
    assert (damage.row, damage.column) == (5, 5)  # of 11 x 11
    assert old[5, 5, 2] == damage.before
    assert new[5, 5, 2] == damage.after == damage.before + 1e-3


def test_all_other_statements_of_the_file_stay(path):
    before = path.read_text("latin-1").split(";")
    damage = move_control_point(path, 1e-3)
    after = path.read_text("latin-1").split(";")
    changed = [b.strip().partition("=")[0] for b, a in zip(before, after, strict=True) if a != b]
    assert changed == [f"#{damage.entity}"]


def test_the_surface_of_the_file_is_off_by_what_its_b_spline_carries(path, lens):
    """In the middle of uniform cubic B-splines one pole counts (2 / 3)^2."""
    assert rear_deviation(path, lens) < 1e-13
    move_control_point(path, 1e-3)
    assert rear_deviation(path, lens) == pytest.approx(1e-3 * 4 / 9, rel=1e-9)


@pytest.mark.parametrize(
    ("z", "text"), [(-1.0, "-1.0"), (0.0, "0.0"), (2.5e-7, "2.5E-07"), (1e-20, "1.E-20")]
)
def test_numbers_are_written_as_step_files_have_them(z, text):
    assert _real(z) == text
    assert float(text) == z


def test_a_file_without_splines_cannot_be_damaged(tmp_path):
    write_step(Lens(FLAT, FLAT, thickness=5.0, index=1.5), tmp_path / "box.step")
    with pytest.raises(ValueError, match="no spline surface whose control points"):
        move_control_point(tmp_path / "box.step", 1e-3)
    with pytest.raises(ValueError, match="is no spline"):
        rear_deviation(tmp_path / "box.step", Lens(FLAT, FLAT, thickness=5.0, index=1.5))
