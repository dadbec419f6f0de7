"""Ray files: bit-exact round trips, files written by hand, and files that lie."""

import struct

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics import UserError
from optics.scene.ray_files import RaySet, read_rays, write_rays
from optics.scene.ray_files.formats import WRITERS
from optics.scene.sources import RayFileSource
from tests.cases import DATA

SUFFIXES = [*WRITERS]
NUMBERS = st.floats(-1e6, 1e6, width=32)
FLUXES = st.floats(2.0**-100, 1e6, width=32)


def directions(seed, n):
    vectors = np.random.default_rng(seed).normal(size=(n, 3))
    return (vectors / np.linalg.norm(vectors, axis=1)[:, None]).astype(np.float32)


@st.composite
def ray_sets(draw):
    n = draw(st.integers(1, 6))
    position = draw(st.lists(NUMBERS, min_size=3 * n, max_size=3 * n))
    flux = draw(st.lists(FLUXES, min_size=n, max_size=n))
    unit = draw(st.sampled_from(["W", "lm"]))
    wavelength = draw(st.sampled_from([None, "one", "each"]))
    row = {None: None, "one": np.full(n, 555.0), "each": np.linspace(400.1, 700.3, n)}[wavelength]
    if unit == "lm" and wavelength == "each":
        row = None
    return RaySet(np.reshape(position, (n, 3)), directions(draw(st.integers(0, 99)), n), flux, unit, row)


def small(n=3, **changes):
    columns = {"position": np.zeros((n, 3)), "direction": directions(0, n), "flux": np.ones(n)}
    return RaySet(**{**columns, **changes})


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(rays=ray_sets())
def test_round_trips_keep_every_bit(tmp_path_factory, suffix, rays):
    path = tmp_path_factory.mktemp("rays") / f"rays{suffix}"
    write_rays(rays, path)
    read = read_rays(path)
    for name in ("position", "direction", "flux"):
        np.testing.assert_array_equal(getattr(read, name), getattr(rays, name))
    assert read.unit == rays.unit
    if rays.wavelength is None:
        assert read.wavelength is None
    else:  # Zemax files hold um
        np.testing.assert_allclose(read.wavelength, rays.wavelength, rtol=2e-7 if suffix == ".dat" else 0)


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(rays=ray_sets(), cut=st.integers(1, 60))
def test_a_cut_file_is_refused_in_one_sentence(tmp_path_factory, suffix, rays, cut):
    path = tmp_path_factory.mktemp("rays") / f"rays{suffix}"
    write_rays(rays, path)
    data = path.read_bytes()
    for kept in (data[:-cut], data[:cut]):
        path.write_bytes(kept)
        with pytest.raises(UserError, match=r"truncated|no binary ray file") as caught:
            read_rays(path)
        assert path.name in str(caught.value)
        assert "\n" not in str(caught.value)


def by_hand_zemax(unit=4, spectral=0, lumens=0, rays=((1, 2, 3, 0, 0, 1, 0.5),), count=None, version=1010):
    head = struct.pack("<iI100s", version, len(rays) if count is None else count, b"by hand")
    head += struct.pack("<7f", 1, 1, 0.45, 0, 0, 0, 0) + struct.pack("<I", unit) + bytes(13 * 4)
    head += struct.pack("<4i", spectral, lumens, 0, 0)
    return head + b"".join(struct.pack(f"<{len(ray)}f", *ray) for ray in rays)


def by_hand_lighttools(rays=((1, 2, 3, 0, 0, 1, 0.5),), major=2, far=0, colour=0, unit=1, origin=(0, 0, 0)):
    head = struct.pack("<4s6I4f", b"LTRF", major, 0, 0, far, colour, unit, *origin, 0.5)
    return head + b"".join(struct.pack(f"<{len(ray)}f", *ray) for ray in rays) + b"LTRFEND"


def by_hand_tm25(
    rays=((1, 2, 3, 0, 0, 1, 0.5),), flags=(1, 1, 1, 0, 0, 0, 0, 0), version=2013, count=None, **head
):
    given = {"spectrum": 0, "wavelength": 0.0, "tables": 0, "own": 0, "text": 0, "behind": b"", **head}
    data = b"TM25" + struct.pack(
        "<ii2fQ", version, 0, float("nan"), 0.5, len(rays) if count is None else count
    )
    data += b"2013-09-04T08:30:29+01:00".ljust(28, b"\0")
    data += struct.pack("<ii3f", 0, given["spectrum"], given["wavelength"], 0, 0)
    data += struct.pack("<3i", given["tables"], given["own"], given["text"]) + bytes(168)
    data += struct.pack("<8i", *flags) + "a lamp".ljust(9000, "\0").encode("utf-32-le")
    assert len(data) == 36288
    return data + given["behind"] + b"".join(struct.pack(f"<{len(ray)}f", *ray) for ray in rays)


TABLE = struct.pack("<i4f", 2, 400, 0.5, 700, 1.0)  # 20 bytes
STOKES = (1, 2, 3, 0, 0, 1, 0.5, 620, 7, 7, 7, 7, 7, 7, 9)
BY_HAND = {
    "zemax, mm": (by_hand_zemax(), 1, 450),
    "zemax, inches": (by_hand_zemax(unit=1), 25.4, 450),
    "zemax, spectral": (by_hand_zemax(spectral=2, rays=[(1, 2, 3, 0, 0, 1, 0.5, 0.62)]), 1, 620),
    "lighttools": (by_hand_lighttools(), 1, None),
    "lighttools, cm, moved": (
        by_hand_lighttools(rays=[(0.5, 1.5, 2.5, 0, 0, 1, 0.5)], unit=2, origin=(0.5,) * 3),
        10,
        None,
    ),
    "lighttools, coloured": (by_hand_lighttools([(1, 2, 3, 0, 0, 1, 0.5, 620)], colour=2), 1, 620),
    "tm25": (by_hand_tm25(), 1, None),
    "tm25, one wavelength": (by_hand_tm25(spectrum=1, wavelength=620.0, version=2020), 1, 620),
    "tm25, table, not padded": (by_hand_tm25(spectrum=3, tables=1, behind=TABLE), 1, None),
    "tm25, table, padded": (by_hand_tm25(spectrum=3, tables=1, behind=TABLE + bytes(12)), 1, None),
    "tm25, own column and text": (
        by_hand_tm25([(1, 2, 3, 0, 0, 1, 0.5, 9)], own=1, text=32, behind=bytes(512 + 32)),
        1,
        None,
    ),
    "tm25, Stokes": (by_hand_tm25([STOKES], (1, 1, 1, 1, 0, 1, 0, 1), spectrum=2), 1, 620),
    "tm25, trailer": (by_hand_tm25() + b"made by a program that signs its work", 1, None),
}


TEXT = "0 0.5 0 0.6 0 0.8 1.5\n1 2 3 0 0 1 0.25\n"
TEXTS = {
    "rows alone": (TEXT, 1.0, "W"),
    "names of columns": ("X Y Z L M N Flux\n" + TEXT, 1.0, "W"),
    "a remark and lumens": ("# from a lamp\nx y z l m n flux [lm]\n" + TEXT, 1.0, "lm"),
    "a count": ("2\n" + TEXT, 1.0, "W"),
    "a count and inches": ("2 1\n" + TEXT, 25.4, "W"),
    "commas": (TEXT.replace(" ", ","), 1.0, "W"),
    "decimal commas between tabs": (TEXT.replace(" ", "\t").replace(".", ","), 1.0, "W"),
    "a remark behind a row": (TEXT.replace("1.5\n", "1.5 # the first\n"), 1.0, "W"),
    "commas at the ends": (TEXT.replace(" ", ",").replace("\n", ",\n"), 1.0, "W"),
    "a unit of inches": ("# unit inch\n" + TEXT, 25.4, "W"),
    "columns in m": ("# x[m] y[m] z[m] l m n flux [W]\n" + TEXT, 1000.0, "W"),
    "a line of units": ("# [cm] [cm] [cm] - - - [lm]\n" + TEXT, 10.0, "lm"),
    "names with units": ("x_mm y_mm z_mm L M N flux in W; positions in 3D\n" + TEXT, 1.0, "W"),
    "a lens of 1 inch": ("# lens of 1 inch, 05.01.2024, wavelength unit: um\n" + TEXT, 1.0, "W"),
    "a date": ("05.01.2024, 14:33 Uhr\n" + TEXT, 1.0, "W"),
    "Fortran exponents": (TEXT.replace("1.5", "15.0D-01"), 1.0, "W"),
}


@pytest.mark.parametrize("name", TEXTS)
def test_rays_as_text_are_read(tmp_path, name):
    text, scale, unit = TEXTS[name]
    (tmp_path / "rays.txt").write_text(text)
    rays = read_rays(tmp_path / "rays.txt")
    np.testing.assert_allclose(rays.position, scale * np.array([[0, 0.5, 0], [1, 2, 3]]), rtol=1e-7)
    np.testing.assert_allclose(rays.direction, [[0.6, 0, 0.8], [0, 0, 1]], rtol=1e-7)
    np.testing.assert_array_equal(rays.flux, [1.5, 0.25])
    assert (rays.unit, rays.wavelength) == (unit, None)


@pytest.mark.parametrize("wavelength", ["0.55", "550"])
def test_wavelengths_of_rays_as_text_are_in_um_or_nm(tmp_path, wavelength):
    (tmp_path / "rays.txt").write_text(f"0 0 0 0 0 1 1 {wavelength}\n")
    np.testing.assert_allclose(read_rays(tmp_path / "rays.txt").wavelength, [550], rtol=1e-6)


def test_ray_files_as_practice_has_them():
    rays = read_rays(DATA / "practice" / "r01_ascii.txt")
    assert len(rays) == 200
    assert rays.total == pytest.approx(200 * 4.5e-5)
    with pytest.raises(UserError, match="400 rays, and 100 more behind them; mend the count"):
        read_rays(DATA / "practice" / "r11_long.dat")


def test_more_rays_than_the_header_says_are_refused_as_fewer_are(tmp_path):
    rays = [(0.1 * k, 2, 3, 0, 0, 1, 0.5) for k in range(5)]
    for data in (by_hand_zemax(rays=rays, count=3), by_hand_tm25(rays, count=3)):
        (tmp_path / "some.file").write_bytes(data)
        with pytest.raises(UserError, match="too long for what its header says: 3 rays, and 2 more"):
            read_rays(tmp_path / "some.file")


@pytest.mark.parametrize("name", BY_HAND)
def test_files_laid_out_by_hand_are_read(tmp_path, name):
    data, scale, wavelength = BY_HAND[name]
    (tmp_path / "some.file").write_bytes(data)
    rays = read_rays(tmp_path / "some.file")
    np.testing.assert_allclose(rays.position, [[scale, 2 * scale, 3 * scale]], rtol=1e-6)
    np.testing.assert_array_equal(rays.direction, [[0, 0, 1]])
    np.testing.assert_array_equal(rays.flux, [np.float32(0.5)])
    assert rays.unit == "W"
    assert (rays.wavelength is None) == (wavelength is None)
    assert wavelength is None or rays.wavelength[0] == pytest.approx(wavelength, rel=1e-6)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "is empty"),
        (b"# LightTools 8.7", "no binary ray file"),
        (b"1 2 3 0 0 1 0.5\n1 2 3 0 0 1\n", "line 2 of .* not 7 numbers; it may be truncated"),
        (b"3\n1 2 3 0 0 1 0.5\n1 2 3 0 0 1 0.5\n", "holds 2 rays, and its head says 3"),
        (b"1\n1 2 3 0 0 1 0.5\n1 2 3 0 0 1 0.5\n", "holds 2 rays, and its head says 1"),
        (b"1 7\n1 2 3 0 0 1 0.5\n", "unknown unit 7 of length"),
        (b"1 2 3 0 0 1 0.5 550 9\n", "rows of 9 numbers"),
        (b"1,,3,4,0,0,1,1,9\n", "line 1 of .* has an empty field"),
        (b"nan 0 0 0 0 1 1\n1 2 3 0 0 1 0.5\n", "line 1 of .* holds 'nan 0 0 0 0 1 1'"),
        (b"0 0 0 0 0 1 1x\n1 2 3 0 0 1 0.5\n", "line 1 of .* holds '0 0 0 0 0 1 1x'"),
        (b"0 0 0 0 0 1\n1 2 3 0 0 1 0.5\n", "line 1 of .* holds '0 0 0 0 0 1', not the numbers"),
        (b"# units: micron\n1 2 3 0 0 1 0.5\n", "its head names the unit micron of length"),
        (b"# unit cm\n1 1\n1 2 3 0 0 1 0.5\n", "several units of length in its head: 10 mm and 25.4 mm"),
        (b"# flux in W, not lm\n1 2 3 0 0 1 0.5\n", "its head names two units of flux, 'in W' and 'lm'"),
        (b"1 2 3 0 0 1 1 0.55\n1 2 3 0 0 1 1 550\n", "wavelengths from 0.55 to 550: up to 30"),
        (b"1 2 3 0 0 2 0.5\n", "direction of ray 0 must have length 1, got 2"),
        (b"\x89PNG\r\n\x1a\n" + bytes(50), "it is a PNG picture"),
        (by_hand_zemax(count=4_000_000_000), "4000000000 rays of 28 bytes behind 208 bytes need"),
        (by_hand_zemax(unit=9), "unknown length unit 9"),
        (by_hand_zemax(spectral=1), "unknown spectral 1"),
        (by_hand_zemax(lumens=5), "unknown flux unit 5"),
        (by_hand_zemax(version=1011), "no binary ray file"),
        (by_hand_zemax(rays=[(1, 2, 3, 0, 0, 2, 1)]), "direction of ray 0 must have length 1, got 2"),
        (by_hand_zemax(rays=[(1, 2, 3, 0, 0, 1, -1)]), "flux of ray 0 must not be negative, got -1"),
        (by_hand_zemax(rays=[(1, float("nan"), 3, 0, 0, 1, 1)]), "position of ray 0 is not finite"),
        (by_hand_zemax(rays=[]), "there must be at least one ray"),
        (by_hand_lighttools(rays=[(1, 2, 3, 0, 0, 1, 0)]), "all rays have no flux"),
        (by_hand_lighttools(major=3), "has version 3"),
        (by_hand_lighttools(far=1), "directions without positions"),
        (by_hand_lighttools(colour=1), "tristimulus values"),
        (by_hand_lighttools(colour=7), "unknown colour 7"),
        (by_hand_lighttools(unit=0), "unknown length unit 0"),
        (by_hand_lighttools()[:-3], "LTRFEND; it may be truncated"),
        (by_hand_tm25(version=2099), "has version 2099 of TM-25; 2013 and 2020 are read"),
        (by_hand_tm25(flags=(1, 1, 0, 0, 0, 0, 0, 0)), "holds no flux"),
        (by_hand_tm25(flags=(0, 1, 1, 0, 0, 0, 0, 0)), "has the flags"),
        (by_hand_tm25(flags=(1, 1, 1, 2, 0, 0, 0, 0)), "has the flags"),
        (by_hand_tm25(count=1 << 62), "is too short for what its header says"),
        (by_hand_tm25(tables=1 << 30), "spectral tables|pairs in its spectral table"),
        (by_hand_tm25(text=-1), "negative size of text, -1"),
        (by_hand_tm25(own=1 << 30), "is too short"),
        (by_hand_tm25(rays=[(0, 0, 0, 9, 9, 9, 1)]), "directions there do not have length 1"),
    ],
)
def test_files_that_lie_are_one_sentence(tmp_path, data, sentence):
    path = tmp_path / "rays.dat"
    path.write_bytes(data)
    with pytest.raises(UserError, match=sentence) as caught:
        read_rays(path)
    assert str(path) in str(caught.value)


def test_a_text_with_rays_is_not_called_a_damaged_binary_file(tmp_path):
    (tmp_path / "rays.txt").write_text("1 2 3 0 0 1 0.5\n1 2 3 0 0 1\n")
    with pytest.raises(UserError, match="line 2") as caught:
        read_rays(tmp_path / "rays.txt")
    assert "binary" not in str(caught.value)


@pytest.mark.parametrize(
    ("made", "sentence"),
    [
        (lambda: small(position=np.zeros((3, 2))), r"the position of rays must have the shape \(3, 3\)"),
        (lambda: small(unit="cd"), 'must be "W" or "lm"'),
        (lambda: small(wavelength=np.array([400, 0, 500])), "wavelengths must be positive"),
        (lambda: write_rays(small(), "rays.txt"), "choose one of .tm25ray, .dat, .ray"),
        (lambda: read_rays("none.ray"), "cannot read none.ray"),
    ],
)
def test_bad_use_is_one_sentence(tmp_path, monkeypatch, made, sentence):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=sentence):
        made()


@pytest.mark.parametrize("suffix", [".dat", ".tm25ray"])
def test_lumens_with_many_wavelengths_are_refused_where_the_format_has_none(tmp_path, suffix):
    rays = small(unit="lm", wavelength=np.array([400.0, 500.0, 600.0]))
    with pytest.raises(UserError, match="no wavelength per ray in lumens"):
        write_rays(rays, tmp_path / f"rays{suffix}")
    assert [*tmp_path.iterdir()] == []


def test_the_same_rays_make_the_same_bytes(tmp_path):
    for suffix in SUFFIXES:
        for name in ("a", "b"):
            write_rays(small(), tmp_path / f"{name}{suffix}")
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_rays_with_both_fluxes_count_by_the_unit_of_the_source(tmp_path):
    """A blue ray of 1 W and 50 lm beside a green one of 1 W and 150 lm."""
    rays = [(1, 0, 0, 0, 0, 1, 1.0, 450, 50.0), (2, 0, 0, 0, 0, 1, 1.0, 550, 150.0)]
    (tmp_path / "two.tm25ray").write_bytes(by_hand_tm25(rays, (1, 1, 1, 1, 1, 0, 0, 0), spectrum=2))
    read = read_rays(tmp_path / "two.tm25ray")
    assert read.unit == "W"
    np.testing.assert_allclose(read.flux, [1, 1])
    np.testing.assert_allclose(read.shares("W"), [0.5, 0.5])
    np.testing.assert_allclose(read.shares("lm"), [0.25, 0.75])
    still = {"shift": (0.0, 0.0), "tilt": (0.0, 0.0, 0.0), "turn": (0.0, 0.0, 0.0)}
    for unit, first in (("W", 4.0), ("lm", 2.0)):
        file = str(tmp_path / "two.tm25ray")
        placed = RayFileSource(flux=8.0, distance=5.0, file=file, unit=unit, **still).placed
        assert placed.flux[placed.origin[0] == 1] == pytest.approx(first)
