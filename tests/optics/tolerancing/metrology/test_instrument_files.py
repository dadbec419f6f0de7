"""Files of instruments: every format gives the same lens, and what is damaged is said in a sentence."""

import re
import struct
import tracemalloc
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import h5py
import numpy as np
import prysm.io
import pytest
import x3pio
from hypothesis import given, strategies as st

from optics.base.runtime import UserError
from optics.tolerancing.metrology import (
    FileFrame,
    by_datums,
    made_surface,
    measured_points,
    read_measured,
)
from optics.tolerancing.metrology.corrected_surface import measured_light
from tests.cases import examples
from tests.optics.tolerancing.metrology.cases import everywhere
from tests.optics.tolerancing.metrology.instrument_cases import (
    HEIGHTS,
    MAIN,
    PITCH,
    POINTS,
    QUANTUM,
    SURFACE,
    X,
    Y,
    dat,
    datx,
    gxyzf,
    x3p,
)

FORMATS: dict[str, Callable[..., bytes]] = {"x3p": x3p, "gxyzf": gxyzf, "dat": dat, "datx": datx}
MADE = made_surface(SURFACE, by_datums(SURFACE, POINTS)).surface
INSIDE = 0.99 * X, 0.99 * Y
MEMORY = 1 << 26  # bytes: what reading the good files takes is a twentieth of it


def written(folder: Path, content: bytes) -> Path:
    """Write a file whose name does not tell its format."""
    path = folder / "measured.bin"
    path.write_bytes(content)
    return path


def in_rows(points: np.ndarray) -> np.ndarray:
    """Return points in the order of rows from -y, along x."""
    return points[:, np.lexsort(points[:2])]


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("content", "within"),
    [
        (x3p(), 1e-12),
        (gxyzf(), 1e-12),
        (gxyzf(unit="mm", ZUnits1=None, ZUnits="um"), 1e-12),
        (dat(), QUANTUM),
        (dat(resolution=0), 8 * QUANTUM),
        (dat(resolution=2), QUANTUM / 4),
        (datx(), 1e-12),
        (datx(fringes=False), 1e-12),
        (datx(chunks=(16, 16), compression="gzip", shuffle=True), 1e-12),
    ],
)
def test_a_made_surface_is_the_same_lens_in_every_format(
    tmp_path: Path, content: bytes, within: float
) -> None:
    """By files that state their units, whatever the frame says of units; heights err by half a quantum."""
    read = read_measured(written(tmp_path, content), SURFACE, FileFrame(unit="nm", height_unit="m"))
    assert (read.missing, read.beside) == (0, 0)
    assert np.abs(in_rows(read.points) - POINTS).max() <= 0.51 * within
    made = made_surface(SURFACE, by_datums(SURFACE, read.points)).surface
    assert np.abs(made.grid(*INSIDE) - MADE.grid(*INSIDE)).max() < within


@pytest.mark.parametrize("resolution", [0, 1])
def test_zygo_files_are_read_as_prysm_reads_them(tmp_path: Path, resolution: int) -> None:
    """Heights with invalid pixels, nm; prysm multiplies in another order."""
    heights = np.where(np.hypot(*np.meshgrid(X - 2, Y + 1)) < 1.5, np.nan, HEIGHTS)
    for content, read in (
        (dat(heights, resolution), prysm.io.read_zygo_dat),
        (datx(heights), prysm.io.read_zygo_datx),
    ):
        path = written(tmp_path, content)
        theirs = read(path)["phase"]
        ours = read_measured(path, SURFACE)
        assert ours.missing == np.isnan(theirs).sum() == np.isnan(heights).sum()
        assert np.allclose(1e6 * ours.points[2], theirs[~np.isnan(theirs)], rtol=1e-15, atol=1e-9)


@pytest.mark.parametrize("name", FORMATS)
def test_what_an_instrument_did_not_see_is_a_gap(tmp_path: Path, name: str) -> None:
    """Where light crosses a gap no +- is printed: `test_gaps`."""
    hole = np.hypot(*np.meshgrid(X - 2, Y + 1)) < 1.5
    heights = np.where(hole, np.nan, HEIGHTS)
    points = np.stack([*POINTS[:2], heights.ravel()])
    content = gxyzf(points) if name == "gxyzf" else FORMATS[name](heights)
    read = read_measured(written(tmp_path, content), SURFACE)
    assert read.missing == hole.sum()
    assert not np.isnan(read.points).any()
    assert measured_light(read.points[:2], everywhere(), SURFACE.outline) < 1


def test_a_grid_from_its_corner_is_centred_where_this_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, x3p(corner=(0.0, 0.0)))
    with pytest.raises(UserError, match="--centre"):
        read_measured(path, SURFACE)
    read = read_measured(path, SURFACE, FileFrame(centre=True, turn=180))
    assert np.allclose(in_rows(read.points)[:2], POINTS[:2], rtol=0, atol=1e-14)


def test_turned_clouds_of_x3p_are_where_x3pio_says(tmp_path: Path) -> None:
    placement = x3pio.Placement.from_axis_angle((0, 0, 1), 0.3)
    out = BytesIO()
    x3pio.write_points(
        out, 1e-3 * POINTS.T, placement=placement, coordinate_system=x3pio.CoordinateSystem.GLOBAL
    )
    assert np.allclose(read_measured(written(tmp_path, out.getvalue()), SURFACE).points, POINTS, atol=1e-14)


def main(*changes: tuple[str, str], **parts: bytes) -> bytes:
    """Return an X3P file whose main.xml has other words."""
    with ZipFile(BytesIO(x3p())) as good:
        text = good.read("main.xml").decode()
    for pattern, new in changes:
        text, count = re.subn(pattern, new, text)
        assert count
    return x3p(
        parts={"main.xml": text, **{"bindata/data.bin": parts["data"]}} if parts else {"main.xml": text}
    )


def told(place: int, layout: str, *numbers: object) -> bytes:
    """Return a MetroPro file with other numbers in its header."""
    return dat(changed=(place, layout, *numbers))


def announcing(size: int) -> bytes:
    """Return an X3P file that says of its points that they unpack to so many bytes."""
    data = x3p()
    true = struct.pack("<I", 8 * HEIGHTS.size)
    assert data.count(true) == 2
    return data.replace(true, struct.pack("<I", size))


def bomb() -> bytes:
    """Return a .datx file with a chunk that unpacks to 64 MB."""

    def change(file) -> None:
        chunk = zlib.compress(bytes(1 << 26), 1)
        file["Data/Surface/{A}"].id.write_direct_chunk((0, 0), chunk)

    return datx(change=change, chunks=HEIGHTS.shape, compression="gzip")


def surface(done: Callable[[h5py.File], object]) -> bytes:
    return datx(change=done)


def attribute(word: str, value: object, place: str = "Data/Surface/{A}") -> bytes:
    """Return a .datx file with another attribute, or without it."""

    def change(file) -> None:
        del file[place].attrs[word]
        if value is not None:
            file[place].attrs[word] = np.array([value])

    return datx(change=change)


def instead(**dataset: object) -> bytes:
    """Return a .datx file with another dataset."""

    def change(file) -> None:
        del file["Data/Surface/{A}"]
        file.create_dataset("Data/Surface/{A}", **dataset)

    return datx(change=change)


LAUGHS = '<!DOCTYPE a [<!ENTITY b "ha"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>\n<p:'
SUM = "[0-9a-f]{32}"
LATERAL = "Data Context.Lateral Resolution:Value"
DAMAGED: dict[str, tuple[Callable[[], bytes], str]] = {
    "x3p cut off": (lambda: x3p()[:20000], "not a zip file"),
    "x3p without main.xml": (lambda: x3p().replace(b"main.xml", b"mean.xml"), "no main.xml"),
    "x3p without points": (lambda: x3p().replace(b"data.bin", b"data.ban"), "is missing"),
    "x3p with a changed point": (lambda: main(data=bytes(8 * HEIGHTS.size)), "MD5"),
    "x3p whose sum was changed": (lambda: main((SUM, "0" * 32)), "MD5"),
    "x3p with fewer points": (lambda: main(data=bytes(800)), "holds 800 bytes"),
    "x3p that is no XML": (lambda: x3p(parts={"main.xml": "<a>"}), "main.xml"),
    "x3p of a million columns": (lambda: main(("<SizeX>81", "<SizeX>1000000")), "65,000,000 points"),
    "x3p of less than no columns": (lambda: main(("<SizeX>81", "<SizeX>-81")), "SizeX"),
    "x3p of no column": (lambda: main(("<SizeX>81", "<SizeX>0")), "0 points"),
    "x3p of two layers": (lambda: main(("<SizeZ>1", "<SizeZ>2")), "2 layers"),
    "x3p of another type": (lambda: main(("<DataType>D", "<DataType>Q")), "DataType"),
    "x3p with no step": (lambda: main((f"{PITCH!r}", "0")), "positive|zero|[Ii]ncrement"),
    "x3p with a step of NaN": (lambda: main((f"{PITCH!r}", "nan")), "[Ii]ncrement"),
    "x3p with a link outside": (lambda: main(("bindata/data.bin", "../../etc/passwd")), "etc/passwd"),
    "x3p with entities": (lambda: main(("<p:", LAUGHS)), "main.xml|[Ee]ntit"),
    "x3p of 2 GB": (lambda: announcing(1 << 31), "unpacks to 2,147,.* bytes, more than"),
    "x3p with 17 MB of main.xml": (
        lambda: x3p(parts={"main.xml": MAIN + " " * 17_000_000}),
        "main.xml unpacks",
    ),
    "x3p without a value": (lambda: x3p(np.full_like(HEIGHTS, np.nan)), "0 points with a value"),
    "gxyzf cut in its header": (lambda: gxyzf()[:60], "may be cut off"),
    "gxyzf cut in its points": (lambda: gxyzf()[:-9], "may be cut off"),
    "gxyzf with more bytes": (lambda: gxyzf() + bytes(8), "bytes, and its header announces"),
    "gxyzf without a number of points": (lambda: gxyzf(NPoints=None), "NPoints"),
    "gxyzf of less than no points": (lambda: gxyzf(NPoints=-5), "NPoints"),
    "gxyzf of 1e8 points": (lambda: gxyzf(NPoints=10**8), "100,000,000 points"),
    "gxyzf of 1e8 channels": (lambda: gxyzf(NChannels=10**8), "may be cut off"),
    "gxyzf without channels": (lambda: gxyzf(NChannels=0), "NChannels"),
    "gxyzf without a unit": (lambda: gxyzf(XYUnits=None), "XYUnits must be one of m, mm"),
    "gxyzf of volts": (lambda: gxyzf(ZUnits1="V"), "ZUnits1 must be .* got 'V'"),
    "gxyzf without a value": (lambda: gxyzf(np.full_like(POINTS, np.nan)), "0 points with a value"),
    "dat cut in its header": (lambda: dat()[:500], "header needs 834 bytes, it has 500"),
    "dat cut in its phases": (lambda: dat()[:-4], "may be cut off"),
    "dat with more bytes": (lambda: dat() + b"\0", "header announces"),
    "dat with a header of 4 GB": (lambda: told(6, "I", 2**32 - 1), "header announces"),
    "dat with more intensities": (lambda: told(56, "H", 9), "header announces"),
    "dat of 65535 x 65535 pixels": (lambda: told(68, "2H", 65535, 65535), "4,294,836,225 points"),
    "dat of no pixel": (lambda: told(68, "2H", 0, 65), "0 points"),
    "dat of another resolution": (lambda: dat(resolution=7), "phase resolution must be 0, 1 or 2, got 7"),
    "dat without a pixel's size": (lambda: told(184, "f", 0.0), "metres per pixel must be positive, got 0"),
    "dat of a wavelength of NaN": (lambda: told(168, "f", np.nan), "wavelength must be positive, got nan"),
    "dat with an endless scale": (lambda: told(164, "f", np.inf), "scale factor must be positive, got inf"),
    "dat of another sign": (lambda: told(232, "H", 1), "data sign is inverted"),
    "dat without a value": (lambda: dat(np.full_like(HEIGHTS, np.nan)), "0 points with a value"),
    "datx cut off": (lambda: datx()[:-100], "truncated"),
    "datx without a surface": (lambda: surface(lambda file: file.__delitem__("Data/Surface")), "Surface"),
    "datx with two surfaces": (
        lambda: surface(lambda file: file.copy("Data/Surface/{A}", "Data/Surface/B")),
        "2 surf",
    ),
    "datx of a line": (lambda: instead(data=np.zeros(5000)), "must be a grid of numbers"),
    "datx of texts": (lambda: instead(data=[[b"a"]]), "must be a grid of numbers"),
    "datx of 1e12 points": (
        lambda: instead(shape=(10**6, 10**6), dtype="f8", chunks=(9, 9)),
        "1,000,000,000,000 points",
    ),
    "datx with a chunk of 1e8": (
        lambda: instead(shape=(9, 9), dtype="f8", maxshape=(None, None), chunks=(10**4,) * 2),
        "0,000 po",
    ),
    "datx with a bomb": (bomb, "unpacks to more than its 42,120 bytes"),
    "datx with another filter": (lambda: datx(compression="lzf"), "another filter than gzip"),
    "datx without No Data": (lambda: attribute("No Data", None), "no attribute 'No Data'"),
    "datx of volts": (lambda: attribute("Unit", b"Volts"), "unit must be one of Fringes, .* got 'Volts'"),
    "datx without a wavelength": (lambda: attribute("Wavelength", None), "no attribute 'Wavelength'"),
    "datx with a wavelength of 0": (
        lambda: attribute("Wavelength", 0.0),
        "Wavelength must be positive, got 0",
    ),
    "datx without a pixel's size": (
        lambda: surface(lambda file: file.__delitem__("Attributes/{B}")),
        "metres per pixel must be positive",
    ),
    "datx with a pixel of NaN": (
        lambda: attribute(f"Surface {LATERAL}", np.nan, "Attributes/{B}"),
        "metres per pixel must be positive, got nan",
    ),
}


@pytest.mark.parametrize(("content", "words"), DAMAGED.values(), ids=DAMAGED)
def test_damaged_files_are_refused_in_a_sentence_and_take_no_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: Callable[[], bytes], words: str
) -> None:
    monkeypatch.setattr(measured_points, "MOST_BYTES", 1 << 20)  # Python reserves as much as it asks for
    path = written(tmp_path, content())
    tracemalloc.start()
    try:
        with pytest.raises(UserError, match=words) as caught:
            read_measured(path, SURFACE)
        assert tracemalloc.get_traced_memory()[1] < MEMORY
    finally:
        tracemalloc.stop()
    assert str(caught.value).startswith(f"{path} ")
    assert "\n" not in str(caught.value)


def test_a_datx_file_leads_to_no_other_file(tmp_path: Path) -> None:
    other = tmp_path / "other.h5"
    other.write_bytes(datx())

    def link(file: h5py.File) -> None:
        del file["Data/Surface/{A}"]
        file["Data/Surface/{A}"] = h5py.ExternalLink(str(other), "Data/Surface/{A}")

    stored = {"shape": HEIGHTS.shape, "dtype": "f8", "external": [(str(other), 0, 8 * HEIGHTS.size)]}
    for content in (datx(change=link), instead(**stored)):
        with pytest.raises(UserError, match="must be a dataset of the file itself"):
            read_measured(written(tmp_path, content), SURFACE)


CONTENTS = {name: make() for name, make in FORMATS.items()}


@examples(40)
@given(st.sampled_from([*FORMATS]), st.floats(0, 1))
def test_files_cut_off_anywhere_are_refused(tmp_path_factory, name: str, part: float) -> None:
    content = CONTENTS[name]
    with pytest.raises(UserError):
        read_measured(
            written(tmp_path_factory.mktemp("cut"), content[: int(part * (len(content) - 1))]), SURFACE
        )


@examples(60)
@given(st.sampled_from(["x3p", "gxyzf", "dat"]), st.integers(0, 1 << 30), st.binary(min_size=1, max_size=4))
def test_changed_bytes_are_read_or_refused(tmp_path_factory, name: str, place: int, new: bytes) -> None:
    content = bytearray(CONTENTS[name])
    at = place % min(len(content), 900 if place % 2 else len(content))
    content[at : at + len(new)] = new
    try:
        read = read_measured(written(tmp_path_factory.mktemp("changed"), bytes(content)), SURFACE)
    except UserError:
        return
    assert np.isfinite(read.points).all()
