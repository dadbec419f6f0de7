"""Measured files: what is read is what was written, and what cannot be read is said in a sentence."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import UserError
from optics.tolerancing.metrology import FileFrame, measured_points, measured_text, read_measured
from tests.cases import DATA, examples
from tests.optics.tolerancing.metrology.cases import HALF_WIDTH, freeform, ripple, scattered
from thbcad.io import cloud_text, sag_text
from thbcad.lens import FreeformSurface
from thbcad.sags import Conic

SURFACE = freeform()
X, Y = scattered(300)
Z = SURFACE(X, Y) + ripple(X, Y)
TABLE = np.column_stack([X, Y, Z])


def written(path: Path, table: np.ndarray, separator: str = " ", header: str = "") -> Path:
    np.savetxt(path, table, "%.17g", delimiter=separator, header=header, comments="")
    return path


@pytest.mark.parametrize("separator", [" ", "\t", ",", ";", ", "])
@pytest.mark.parametrize("header", ["", "x,y,z", "# points\n\nX [mm] Y [mm] Z [mm]\n-----"])
def test_rows_come_back_bit_for_bit(tmp_path: Path, separator: str, header: str) -> None:
    read = read_measured(written(tmp_path / "a.xyz", TABLE, separator, header), SURFACE)
    assert np.array_equal(read.points, TABLE.T)
    assert (read.missing, read.beside) == (0, 0)


def test_decimal_commas_are_read(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", TABLE, ";")
    path.write_text(path.read_text().replace(".", ","), encoding="utf-8")
    assert np.array_equal(read_measured(path, SURFACE).points, TABLE.T)


def test_rows_without_a_value_are_left_out_and_counted(tmp_path: Path) -> None:
    rows = [f"{x!r} {y!r} {z!r}" for x, y, z in TABLE.tolist()]
    marks = ["NaN", "*****", "No Data", "-nan", "inf", "1.#QNAN", "-1.#IND00", "1.#INF", "-nan(ind)"]
    for k, mark in enumerate(marks):
        rows[7 * k] = f"{k} 1.5 {mark}"
    path = tmp_path / "a.dat"
    path.write_text("\n".join(rows), encoding="utf-8")
    read = read_measured(path, SURFACE)
    kept = np.setdiff1d(np.arange(len(TABLE)), 7 * np.arange(len(marks)))
    assert read.missing == len(marks)
    assert np.array_equal(read.points, TABLE[kept].T)


@examples(8)
@given(
    st.sampled_from(["m", "mm", "um", "nm"]),
    st.sampled_from(["m", "mm", "um", "nm"]),
    st.booleans(),
    st.sampled_from([0, 90, 180, 270]),
    st.booleans(),
    st.sampled_from(["heights", "errors"]),
)
def test_units_and_orientation_are_undone(
    tmp_path_factory: pytest.TempPathFactory, unit, height_unit, mirror, turn, down, kind
) -> None:
    """The file holds the points as an instrument with another frame writes them."""
    scale = {"m": 1e-3, "mm": 1.0, "um": 1e3, "nm": 1e6}
    angle = np.radians(-turn)  # the reader turns them back
    x, y = np.cos(angle) * X - np.sin(angle) * Y, np.sin(angle) * X + np.cos(angle) * Y
    x, z = -x if mirror else x, Z if kind == "heights" else Z - SURFACE(X, Y)
    table = np.column_stack([scale[unit] * x, scale[unit] * y, scale[height_unit] * (-z if down else z)])
    path = written(tmp_path_factory.mktemp("measured") / "a.xyz", table)
    frame = FileFrame(unit, height_unit, kind, mirror, turn, down)
    assert np.allclose(read_measured(path, SURFACE, frame).points, TABLE.T, rtol=0, atol=1e-13)


def test_the_files_that_thbcad_writes_are_read(tmp_path: Path) -> None:
    cloud, grid = tmp_path / "cloud.xyz", tmp_path / "grid.dat"
    cloud.write_bytes(cloud_text(SURFACE, 0.0, True, (21, 17)))
    grid.write_bytes(sag_text(SURFACE, (21, 17)))
    for path in (cloud, grid):
        x, y, z = read_measured(path, SURFACE).points
        assert len(x) == 21 * 17
        assert np.abs(z - SURFACE(x, y)).max() < 1e-14 * 100


@pytest.mark.parametrize("last", ["", "\t0"])
def test_nothing_between_tabs_is_no_value(tmp_path: Path, last: str) -> None:
    rows = [
        f"{x!r}\t{y!r}\t{'' if k % 9 == 4 else repr(z)}{last}" for k, (x, y, z) in enumerate(TABLE.tolist())
    ]
    (tmp_path / "a.txt").write_text("x\ty\tz\n" + "\n".join(rows), encoding="utf-8")
    read = read_measured(tmp_path / "a.txt", SURFACE)
    kept = np.arange(len(TABLE)) % 9 != 4
    assert read.missing == np.sum(~kept)
    assert np.array_equal(read.points, TABLE[kept].T)


def test_columns_may_be_aligned_by_several_tabs(tmp_path: Path) -> None:
    read = read_measured(written(tmp_path / "a.txt", TABLE, "\t\t"), SURFACE)
    assert np.array_equal(read.points, TABLE.T)


def test_points_of_a_grid_may_be_flagged_alone(tmp_path: Path) -> None:
    grid = tmp_path / "grid.dat"
    grid.write_bytes(sag_text(SURFACE, (21, 17)))
    head, *rows = grid.read_text().splitlines()
    whole = read_measured(grid, SURFACE).points
    gone = np.arange(len(rows)) % 10 == 3
    short = ["0 0 0 0 1" if no else " ".join(row.split()[:4]) for no, row in zip(gone, rows)]
    grid.write_text("\n".join([head, *short]))
    read = read_measured(grid, SURFACE)
    assert read.missing == gone.sum()
    assert {*map(tuple, read.points.T)} < {*map(tuple, whole.T)}


def test_points_beside_the_surface_are_counted(tmp_path: Path) -> None:
    table = np.concatenate([TABLE, [[HALF_WIDTH[0] + 1, 0, 0], [0, -HALF_WIDTH[1] - 1, 0]]])
    assert read_measured(written(tmp_path / "a.xyz", table), SURFACE).beside == 2


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "is empty"),
        ("x y z\nno numbers here\n", "holds no row of 3 numbers"),
        ("1 2 3\n1 2\n", "line 2 .* may be cut off"),
        ("1 2 3\n4 5 six\n", "line 2 "),
        ("1 2 3\n" * 5, "holds 5 points"),
        ("\0\1\2", "is no text"),
        ("5 5 1.0 1.0 0 0 0\n" + "0 0 0 0 0\n" * 24, "announces 25 points and holds 24"),
        ("5 5 1.0 1.0 7 0 0\n" + "0 0 0 0 0\n" * 25, "unit flag"),
        ("99999 99999 1.0 1.0 0 0 0\n", "announces more than 2,000,000 points"),
        ("1e300 1e300 1.0 1.0 0 0 0\n", "announces more than 2,000,000 points"),
    ],
)
def test_bad_files_are_refused_in_a_sentence(tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / "bad.xyz"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(UserError, match=words) as caught:
        read_measured(path, SURFACE)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("table", "frame", "words"),
    [
        (1e3 * TABLE, FileFrame(), "is the unit right"),
        (1e-3 * TABLE, FileFrame(), "is the unit right"),
        (TABLE * [1, 1, 1e3], FileFrame(), "--height-unit"),
        (TABLE + np.array([0, 0, 40]), FileFrame(), "--surface"),
        (TABLE + np.array([0, 0, 6]), FileFrame(), "its origin right. It is the vertex of the surface"),
    ],
)
def test_numbers_in_another_unit_are_noticed(tmp_path: Path, table, frame, words) -> None:
    with pytest.raises(UserError, match=words):
        read_measured(written(tmp_path / "a.xyz", table), SURFACE, frame)


def test_a_missing_file_and_a_wrong_word_are_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot read"):
        read_measured(tmp_path / "none.xyz", SURFACE)
    with pytest.raises(UserError, match="unit must be one of m, mm, um, nm, got 'inch'"):
        FileFrame(unit="inch")


PARABOLA = FreeformSurface((10.0, 10.0), Conic(40.0, -1.0))


def test_errors_with_decimal_commas_between_tabs_have_their_rms() -> None:
    """x, y in mm and dz in um with one decimal, as a German program writes them."""
    frame = FileFrame(height_unit="um", kind="errors")
    x, y, z = read_measured(DATA / "practice" / "m12_errors_one_decimal_tab.txt", PARABOLA, frame).points
    assert np.sqrt(np.mean((z - PARABOLA(x, y)) ** 2)) == pytest.approx(0.14525e-3, abs=5e-9)
    assert (x.min(), x.max(), y.min(), y.max()) == (-9.1, 9.1, -9.1, 9.1)


def test_fortran_exponents_are_read() -> None:
    x, y, z = read_measured(DATA / "practice" / "m09_fortran_D.txt", PARABOLA).points
    assert len(x) == 625
    np.testing.assert_allclose(z - (x**2 + y**2) / 100, 0, atol=1e-7)


@pytest.mark.parametrize("word", ["4_5.0", "\u0664\u0665", "\uff11"])
def test_digits_that_are_not_ascii_are_refused_with_their_line(tmp_path: Path, word: str) -> None:
    path = tmp_path / "a.xyz"
    path.write_text("x y z\n1 2 3\n" + f"1 {word} 3\n", encoding="utf-8")
    with pytest.raises(UserError, match=r"line 3 of .* not 3 numbers"):
        read_measured(path, SURFACE)


def test_too_many_lines_are_refused_before_they_are_read(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "a.xyz"
    path.write_text("1 2 3\n" * 30_000, encoding="utf-8")
    monkeypatch.setattr(measured_text, "MOST_LINES", 29_999)
    monkeypatch.setattr(np, "loadtxt", None)
    with pytest.raises(UserError, match="has 30,000 lines, and at most 2,000,000 points are read"):
        read_measured(path, SURFACE)


def test_a_device_without_end_is_refused(monkeypatch) -> None:
    monkeypatch.setattr(measured_points, "MOST_BYTES", 1000)
    with pytest.raises(UserError, match="larger than the 1,000 bytes allowed"):
        read_measured("/dev/zero", SURFACE)
