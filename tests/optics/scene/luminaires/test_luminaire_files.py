"""IES and EULUMDAT: round trips, second readers, symmetry, units, and bad files."""

import re
from contextlib import suppress
from time import perf_counter

import numpy as np
import pytest
from hypothesis import given, strategies as st
from photompy import IESFile
from pyldt import LdtReader

from optics.base.runtime import UserError
from optics.scene.luminaires import Luminaire, Opening, read_luminaire, write_ies, write_ldt
from tests.cases import DATA, examples
from tests.optics.scene.luminaires.cases import GAMMA, C, asymmetric, ies_text, ldt_lines

WRITERS = {".ies": write_ies, ".ldt": write_ldt}


def written(folder, text, name="lamp"):
    path = folder / name
    path.write_bytes(text.encode("latin-1") if isinstance(text, str) else text)
    return path


def of_ies(folder, **changes):
    return read_luminaire(written(folder, ies_text(**changes)))


def of_ldt(folder, **changes):
    return read_luminaire(written(folder, "\r\n".join(ldt_lines(**changes))))


# Second readers


def test_photompy_reads_what_was_written_as_ies(tmp_path):
    lamp = asymmetric()
    write_ies(lamp, tmp_path / "lamp.ies", "street")
    theirs = IESFile.read(tmp_path / "lamp.ies")
    np.testing.assert_array_equal(theirs.photometry.phis, C)
    np.testing.assert_array_equal(theirs.photometry.thetas, GAMMA)
    np.testing.assert_allclose(theirs.photometry.values, lamp.candela, atol=1e-4)
    assert (theirs.header.lumens_per_lamp, theirs.header.units) == (-1, 2)
    assert (theirs.header.length, theirs.header.width) == (0.06, 0.02)  # along C = 0, and across
    assert theirs.header.keywords["LUMCAT"] == "street"


def test_eulumdat_py_reads_what_was_written_as_ldt(tmp_path):
    lamp = asymmetric()
    write_ldt(lamp, tmp_path / "lamp.ldt", "street")
    theirs = LdtReader.read(tmp_path / "lamp.ldt")
    head = theirs.header
    np.testing.assert_array_equal(head.c_angles, C[:-1])
    np.testing.assert_array_equal(head.g_angles, GAMMA)
    candela = np.array(theirs.intensities) * head.lamp_flux[0] / 1000
    np.testing.assert_allclose(candela, lamp.candela[:-1], atol=1e-8 * lamp.flux)
    assert head.lamp_flux[0] == lamp.flux
    assert (head.length_lum_area, head.width_lum_area) == (20, 60)  # along C = 90, and across
    assert (head.luminaire_name, head.num_lamps, head.isym) == ("street", [-1], 0)
    assert head.dff == pytest.approx(100 * lamp.flux_within(90.0) / lamp.flux, abs=1e-5)


@pytest.mark.parametrize(
    "planes",
    [(0,), (0, 45, 90), (0, 60, 120, 180), (0, 30, 90, 180, 270, 360)],
    ids=["0", "90", "180", "360"],
)
def test_symmetric_ies_files_are_expanded_as_photompy_expands_them(tmp_path, planes):
    """Symmetric planes are even here: photompy 0.3.1 puts mirror images of uneven ones elsewhere."""
    candela = np.random.default_rng(len(planes)).integers(1, 900, (len(planes), 4))
    candela[-1] = candela[-1] if planes[-1] < 360 else candela[0]
    path = written(tmp_path, ies_text(planes, (0, 30, 90, 180), candela, multiplier=3), "lamp.ies")
    lamp, theirs = read_luminaire(path), IESFile.read(path).photometry.expanded()
    c, gamma = np.meshgrid(theirs.phis, theirs.thetas, indexing="ij")
    found = lamp.at(c.ravel().astype(float), gamma.ravel()).reshape(c.shape)
    np.testing.assert_allclose(found, theirs.values, rtol=1e-13)


@pytest.mark.parametrize(
    ("symmetry", "held"),
    [(0, 8), (1, 1), (2, 5), (3, 5), (4, 3)],
)
def test_symmetric_ldt_files_are_expanded_as_eulumdat_py_expands_them(tmp_path, symmetry, held):
    rng = np.random.default_rng(symmetry)
    planes = np.arange(0, 360, 45)
    lines = ldt_lines(symmetry, planes, (0, 30, 90, 180), rng.integers(1, 900, (held, 4)))
    path = written(tmp_path, "\n".join(lines))
    lamp, theirs = read_luminaire(path), LdtReader.read(path)
    c, gamma = np.meshgrid(planes, (0, 30, 90, 180), indexing="ij")
    found = lamp.at(c.ravel(), gamma.ravel()).reshape(c.shape)
    np.testing.assert_allclose(found, 2.0 * np.array(theirs.intensities), rtol=1e-14)


# Round trips

decimals = st.floats(0, 1000).map(lambda value: round(value, 2))


@st.composite
def luminaires(draw):
    inner = draw(st.lists(st.integers(1, 3599), min_size=1, max_size=5, unique=True).map(sorted))
    gammas = draw(st.lists(st.integers(0, 1800), min_size=2, max_size=6, unique=True).map(sorted))
    planes = np.array([0, *inner, 3600]) / 10
    values = st.lists(decimals, min_size=len(gammas), max_size=len(gammas))
    rows = draw(st.lists(values, min_size=len(inner) + 1, max_size=len(inner) + 1))
    candela = np.array([*rows, rows[0]])
    candela[:, 1] += 0.5  # some light
    a, b = (round(draw(st.floats(0.1, 2000)), 1) for _ in range(2))
    return Luminaire(planes, np.array(gammas) / 10, candela, Opening((a, b)))


@examples(60)
@given(lamp=luminaires(), suffix=st.sampled_from([*WRITERS]), scale=st.sampled_from([1e-9, 1e-3, 1.0, 1e4]))
def test_what_is_written_is_read_again_to_the_digits_written(tmp_path_factory, lamp, suffix, scale):
    path = tmp_path_factory.mktemp("files") / f"lamp{suffix}"
    lamp = Luminaire(lamp.planes, lamp.gammas, scale * lamp.candela, lamp.opening)
    WRITERS[suffix](lamp, path)
    found = read_luminaire(path)
    np.testing.assert_array_equal(found.planes, lamp.planes)
    np.testing.assert_array_equal(found.gammas, lamp.gammas)
    # .ies: four decimals of at least 1e8 at the peak; .ldt: five of cd per 1000 lm
    digit = 1e-12 * lamp.candela.max() if suffix == ".ies" else 1e-8 * lamp.flux
    np.testing.assert_allclose(found.candela, lamp.candela, atol=0.51 * digit, rtol=1e-14)
    assert found.flux == pytest.approx(lamp.flux, rel=1e-6, abs=13 * digit)
    np.testing.assert_allclose(found.opening.size, lamp.opening.size, atol=1e-9)


@pytest.mark.parametrize("peak", [3e-7, 0.02, 99.0, 2e3, 4e9])
def test_rounding_of_an_ies_file_takes_no_flux_of_a_narrow_beam(tmp_path, peak):
    """The beam has one node of half a degree; what else there is would round down everywhere."""
    gammas = np.arange(0, 180.25, 0.5)
    candela = np.full((2, len(gammas)), 1.4142e-10 * peak)
    candela[:, 0] = peak
    lamp = Luminaire([0.0, 360.0], gammas, candela)
    write_ies(lamp, tmp_path / "lamp.ies")
    found = read_luminaire(tmp_path / "lamp.ies")
    assert found.flux == pytest.approx(lamp.flux, rel=1e-7)  # a tenth of what `thbcad export` allows
    numbers = (tmp_path / "lamp.ies").read_text().partition("TILT=NONE")[2]
    assert re.fullmatch(r"[-\d.\s]+", numbers)  # no exponents
    assert max(map(len, numbers.splitlines())) <= 132  # LM-63


@pytest.mark.parametrize("suffix", WRITERS)
def test_the_same_luminaire_gives_the_same_bytes(tmp_path, suffix):
    for name in ("a", "b"):
        WRITERS[suffix](asymmetric(Opening((30.0, 30.0), round=True)), tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert read_luminaire(tmp_path / "a").opening == Opening((30.0, 30.0), round=True)


# What IES says


@pytest.mark.parametrize(
    ("planes", "at_0", "at_50", "at_130", "at_230", "at_310"),
    [
        ((0,), 100, 100, 100, 100, 100),
        ((0, 90), 100, 155.555556, 155.555556, 155.555556, 155.555556),
        ((0, 180), 100, 127.777778, 172.222222, 172.222222, 127.777778),
        ((90, 270), 150, 122.222222, 122.222222, 177.777778, 177.777778),
        ((0, 200, 360), 100, 125, 165, 181.25, 131.25),
    ],
)
def test_the_last_plane_tells_the_symmetry(tmp_path, planes, at_0, at_50, at_130, at_230, at_310):
    """Candelas rise from 100 to 200 from the first to the second plane."""
    candela = [[100] * 3, [200] * 3, [100] * 3][: len(planes)]
    lamp = of_ies(tmp_path, planes=planes, candela=candela)
    found = lamp.at(np.array([0.0, 50.0, 130.0, 230.0, 310.0]), np.full(5, 45.0))
    np.testing.assert_allclose(found, [at_0, at_50, at_130, at_230, at_310], rtol=1e-8)


@pytest.mark.parametrize(
    ("first", "factor"),
    [
        ("LUMINAIRE of 1986", 3.0),
        ("IESNA91", 3.0),
        ("IESNA:LM-63-1995", 3.0),
        ("IESNA:LM-63-2002", 2.0),
        ("IES:LM-63-2019", 2.0),
    ],
)
def test_ballast_factors_count_as_in_the_year_of_the_file(tmp_path, first, factor):
    """2002 and 2019 have something else in the place of the ballast-lamp factor."""
    lamp = of_ies(tmp_path, first=first, multiplier=4, ballast=0.5, future=1.5)
    assert lamp.at(np.zeros(1), np.zeros(1)) == pytest.approx(factor * 100)


def test_factors_of_tilt_count_for_a_luminaire_that_is_not_tilted(tmp_path):
    lamp = of_ies(tmp_path, header="TILT=INCLUDE\n1\n3\n0 45 90\n0.5 0.4\n0.3")
    assert lamp.flux == pytest.approx(0.5 * of_ies(tmp_path).flux)


OLD = ("LUMINAIRE of 1986", "IESNA91", "IESNA:LM-63-1995")
NEW = ("IESNA:LM-63-2002", "IES:LM-63-2019")


@pytest.mark.parametrize(
    ("years", "size", "opening"),
    [
        (OLD + NEW, "0.2 0.6 0", Opening((600.0, 200.0))),
        (OLD + NEW, "0.2 0.6 0.1", Opening((600.0, 200.0))),  # a box
        (OLD + NEW, "0 0 0", Opening()),
        (OLD + NEW, "0 0.6 0.1", Opening((600.0, 0.0))),  # a rectangle on edge
        (OLD + NEW, "-0.1 0 0", Opening((100.0, 100.0), round=True)),
        (OLD + NEW, "-0.1 0 0.3", Opening((100.0, 100.0), round=True)),  # a vertical cylinder
        (OLD + NEW, "-0.12 0.34 0", Opening((340.0, 120.0), round=True)),
        (OLD, "-0.12 0.34 0.2", Opening((340.0, 120.0), round=True)),
        (OLD, "0.12 -0.34 0.2", Opening((340.0, 120.0), round=True)),
        (OLD, "-0.12 0.34 -0.2", Opening((340.0, 120.0), round=True)),  # an ellipsoid
        (OLD, "-0.1 0 -0.1", Opening((100.0, 100.0), round=True)),  # a sphere
        (OLD, "0 0.6 -0.1", Opening((600.0, 100.0))),  # a cylinder along the length
        (OLD, "0.6 0 -0.1", Opening((100.0, 600.0))),  # across it
        (NEW, "-0.2 -0.2 0", Opening((200.0, 200.0), round=True)),
        (NEW, "-0.2 -0.5 0.1", Opening((500.0, 200.0), round=True)),
        (NEW, "-0.2 -0.2 -0.2", Opening((200.0, 200.0), round=True)),  # a sphere
        (NEW, "-0.2 -0.5 -0.3", Opening((500.0, 200.0), round=True)),
        (NEW, "-0.1 0.6 -0.1", Opening((600.0, 100.0))),  # a cylinder along the length
        (NEW, "-0.1 0.6 -0.2", Opening((600.0, 100.0))),
        (NEW, "0.6 -0.1 -0.1", Opening((100.0, 600.0))),  # across it
        (NEW, "0 -0.3 -0.3", Opening((300.0, 0.0))),  # a disk on edge
    ],
)
@pytest.mark.parametrize(("units", "unit"), [(2, 1.0), (1, 0.3048)])
def test_openings_are_mm_along_x_and_y_by_the_signs_of_every_edition(
    tmp_path, years, size, opening, units, unit
):
    """Signs as the editions have them in their tables, of which Radiance's ies2rad holds a copy."""
    for first in years:
        found = of_ies(tmp_path, first=first, size=size, units=units).opening
        assert found.size == pytest.approx([unit * side for side in opening.size]), first
        assert found.round == opening.round, first


PRACTICE = {
    "l01_crlf.ies": Opening((300.0, 100.0)),
    "l02_typeB.ies": Opening((300.0, 100.0)),
    "l05_ellipse_1995.ies": Opening((340.0, 120.0), round=True),
    "d02_blank_ratios.ldt": Opening((100.0, 300.0)),
    "d04_name_tilt.ldt": Opening((100.0, 300.0)),
}


@pytest.mark.parametrize("name", PRACTICE)
def test_files_as_practice_has_them_have_their_flux(name):
    """The flux was computed without this project."""
    lamp = read_luminaire(DATA / "practice" / name)
    assert lamp.flux == pytest.approx(684.9555921, abs=1e-7)
    assert lamp.opening.size == pytest.approx(PRACTICE[name].size)
    assert lamp.opening.round == PRACTICE[name].round


def test_written_ies_files_have_cr_lf(tmp_path):
    write_ies(asymmetric(), tmp_path / "lamp.ies")
    data = (tmp_path / "lamp.ies").read_bytes()
    assert data.count(b"\n") == data.count(b"\r\n") > 10
    assert data.endswith(b"\r\n")


@pytest.mark.parametrize("at", [0, 7, 8, 9, 10, 11, 27])
@pytest.mark.parametrize("text", ["TILT=15 flood", "TILT=NONE", "IESNA:LM-63-2002", "[TEST] 5"])
def test_names_do_not_decide_the_format(tmp_path, at, text):
    """A file whose counts stand in the lines of EULUMDAT is one, whatever its texts are."""
    lines = ldt_lines()
    lines[at] = text
    assert read_luminaire(written(tmp_path, "\n".join(lines))).flux == of_ldt(tmp_path).flux


def test_the_last_line_of_tilt_counts_in_an_ies_file_and_decimal_commas_do(tmp_path):
    plain = of_ies(tmp_path)
    early = of_ies(tmp_path, header="TILT=40 DEGREES, a floodlight\n[TEST] none\nTILT=NONE")
    np.testing.assert_array_equal(early.candela, plain.candela)
    commas = of_ies(tmp_path, size="0,2 0,6 0")
    np.testing.assert_array_equal(commas.candela, plain.candela)
    assert commas.opening == plain.opening


def test_planes_at_0_and_360_are_one_plane_measured_twice(tmp_path):
    lamp = of_ies(tmp_path, planes=(0, 180, 360), candela=((100, 50, 0), (80, 40, 0), (100, 52, 0)))
    np.testing.assert_array_equal(lamp.candela, [[100, 51, 0], [80, 40, 0], [100, 51, 0]])


def test_three_steps_of_90_degrees_are_a_full_turn(tmp_path):
    candela = ((100, 50, 0), (80, 40, 0), (90, 45, 0), (70, 35, 0))
    lamp = of_ies(tmp_path, planes=(0, 90, 180, 270), candela=candela)
    np.testing.assert_array_equal(lamp.candela, [*candela, candela[0]])


def test_lumens_of_minus_1_are_absolute_photometry(tmp_path):
    assert of_ies(tmp_path, lumens=-1).lumens is None
    assert of_ies(tmp_path, lumens=500, lamps=2).lumens == 1000
    assert of_ies(tmp_path, lumens=-1).flux == of_ies(tmp_path, lumens=500).flux


def test_numbers_may_be_parted_by_commas_and_lines_and_names_may_be_latin(tmp_path):
    text = ies_text(header="[MANUFAC] Lichtstärke\r\ntilt = none").replace("0 45 90", "0,\r\n45,90")
    assert read_luminaire(written(tmp_path, text)).flux == of_ies(tmp_path).flux


# What EULUMDAT says


def test_cd_per_klm_are_scaled_by_the_lumens_of_the_lamps(tmp_path):
    lamp = of_ldt(tmp_path, lumens=2500.0)
    assert lamp.candela.max() == 500.0
    assert lamp.lumens == 2500.0
    assert lamp.opening == Opening((180.0, 580.0))
    assert read_luminaire(written(tmp_path, changed(23, "1.5"))).candela.max() == 600.0
    comma = [line.replace(".", ",") for line in ldt_lines(lumens=2500.0)]
    assert read_luminaire(written(tmp_path, "\n".join(comma))).flux == lamp.flux


def test_a_width_of_zero_is_a_round_opening(tmp_path):
    lines = ldt_lines()
    lines[15:17] = "150", "0"
    found = read_luminaire(written(tmp_path, "\n".join(lines))).opening
    assert found == Opening((150.0, 150.0), round=True)


# Bad files


def changed(index, value):
    lines = ldt_lines()
    lines[index] = value
    return "\n".join(lines)


def cut(text, count):
    return " ".join(text.split(" ")[:-count])


def without_ballast(text):
    return text.replace(" 1 1 10\n", "\n")


BAD = {
    "empty": ("", "is empty"),
    "zeros": (b"IES\0\0", "is no text"),
    "noise": (bytes(range(1, 200)), "has no line TILT="),
    "words": ("a\nb\nc\nd\n", "symmetry"),
    "ies: ends early": (cut(ies_text(), 1), "promises 3 candela values, and 2 numbers are left"),
    "ies: only a head": ("IESNA91\nTILT=NONE\n1 -1", "ends before its candela multiplier"),
    "ies: a word at the end": (ies_text() + "[END]\n", r"text follows its last number, from '\[END\]' on"),
    "ies: more numbers": (ies_text() + "7 7\n", "2 more numbers follow"),
    "ies: a huge count": (ies_text(verticals=10**9), "from 2 to 100000"),
    "ies: huge counts": (ies_text(verticals=99999, horizontals=99999), "promises 99999 vertical"),
    "ies: a broken count": (ies_text(verticals=2.5), "must be a whole number"),
    "ies: a negative count": (ies_text(horizontals=-3), "from 1 to 100000"),
    "ies: no number": (ies_text(lamps="one"), "number of lamps must be numbers, got 'one'"),
    "ies: not a number": (ies_text(candela=((100, "nan", 0),)), "candela values must be finite"),
    "ies: infinite": (ies_text(multiplier="inf"), "candela multiplier must be finite"),
    "ies: a dark multiplier": (ies_text(multiplier=0), "multiplier must be greater than 0"),
    "ies: a negative ballast": (ies_text(ballast=-1), "ballast factor must be greater than 0"),
    "ies: no line with the ballast factor": (
        without_ballast(ies_text()),
        "3 ascending numbers from 0 to 90 are where its ballast factor must be; the line with ballast "
        "factor, future use and input watts may be missing: add it before the vertical angles, such as 1 1 0",
    ),
    "ies: the same of light that goes up": (
        without_ballast(ies_text(gammas=(90, 120, 180))),
        "3 ascending numbers from 90 to 180 are where its ballast factor must be",
    ),
    "ies: ends early, after rising numbers": (
        ies_text(ballast=0.9, watts=50, candela=()),
        "promises 3 candela values, and 0 numbers are left",
    ),
    "ies: negative light": (ies_text(candela=((100, -1, 0),)), "must not be negative, got -1 cd"),
    "ies: dark": (ies_text(candela=((0, 0, 0),)), "flux of a luminaire must be"),
    "ies: light beyond numbers": (ies_text(multiplier=1e308), "candela must be finite"),
    "ies: type B, a horizontal angle of 100": (
        ies_text((0, 100), kind=2, candela=((1, 1, 1),) * 2),
        "horizontal angles of types A and B lie between -90 and 90 degrees, got 0 to 100",
    ),
    "ies: type A, one plane that is not even": (
        ies_text(kind=3, gammas=(-45, 0, 45)),
        "one horizontal angle means light that is symmetric around the beam",
    ),
    "ies: type 4": (ies_text(kind=4), "photometric type must be a whole number from 1 to 3"),
    "ies: inches": (ies_text(units=3), "units type must be"),
    "ies: angles fall": (ies_text(gammas=(0, 90, 45)), "gamma must ascend, got 45 after 90"),
    "ies: angles twice": (ies_text(gammas=(0, 45, 45)), "gamma must ascend"),
    "ies: beyond the pole": (ies_text(gammas=(0, 90, 190)), "between 0 and 180"),
    "ies: planes fall": (ies_text(planes=(0, 90, 45), candela=((1, 1, 1),) * 3), "C must ascend"),
    "ies: planes to 100": (ies_text(planes=(0, 100), candela=((1, 1, 1),) * 2), "from 0 to 100 degrees"),
    "ies: tilt": (ies_text(header="TILT=tilt.txt"), "factors of tilt are in 'tilt.txt'"),
    "ies: tilts": (ies_text(header="TILT=INCLUDE\n1\n9999\n0 90"), "promises 9999 tilt angles"),
    "ies: one decimal comma": (ies_text(candela=(("100,5", 80, 0),)), "such as '100,5'; a comma separates"),
    "ies: marks of thousands": (
        ies_text(lumens="1,000"),
        "write decimal points, and thousands without a mark",
    ),
    "ies: commas between, and too few": (
        ies_text(candela=(("100,80",),)),
        "promises 3 candela values, and 2 numbers are left",
    ),
    "ldt: ends early": ("\n".join(ldt_lines()[:-2]), "promises 12 intensities, and 10 numbers are left"),
    "ldt: only a head": ("\n".join(ldt_lines()[:20]), "ends before its"),
    "ldt: more numbers": ("\n".join([*ldt_lines(), "5"]), "1 more number follows"),
    "ldt: symmetry 7": (changed(2, "7"), "symmetry .line 3. must be a whole number from 0 to 4"),
    "ldt: no count": (changed(3, ""), "number of planes C .line 4. must be numbers"),
    "ldt: a huge count": (changed(5, "1e12"), "number of angles gamma .line 6. must be a whole"),
    "ldt: many planes": (changed(3, "50000"), "promises 50000 planes C"),
    "ldt: no lumens": (changed(28, "0"), "must be greater than 0, got 0"),
    "ldt: a negative factor": (changed(23, "-1"), "conversion factor must be greater than 0"),
    "ldt: not a number": (changed(-1, "NaN"), "intensities must be finite"),
    "ldt: negative light": (changed(-1, "-3"), "must not be negative"),
    "ldt: planes fall": (changed(43, "0"), "C must ascend"),
    "ies: two halves of a plane": (
        ies_text(planes=(0, 360), candela=((100, 50, 0), (100, 60, 0))),
        "C = 0 and C = 360 differ",
    ),
    "ies: a part of a turn": (
        ies_text((0, 30, 60, 200), candela=((1, 1, 1),) * 4),
        "planes C run from 0 to 200 degrees",
    ),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(99), "is no text: it is a PNG picture"),
    "ldt: odd symmetry": ("\n".join(ldt_lines(4, (0, 120, 240))), "multiples of 4, got 3"),
}


@pytest.mark.parametrize(("data", "words"), BAD.values(), ids=BAD.keys())
def test_bad_files_are_one_sentence_that_names_the_file(tmp_path, data, words):
    path = written(tmp_path, data, "bad.file")
    with pytest.raises(UserError, match=words) as raised:
        read_luminaire(path)
    assert "bad.file" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_files_that_are_not_there_or_too_long_are_refused(tmp_path):
    with pytest.raises(UserError, match=r"none\.ies"):
        read_luminaire(tmp_path / "none.ies")
    with pytest.raises(UserError, match="larger than"):
        read_luminaire(written(tmp_path, b"1 " * 10_000_001))


def test_commas_between_numbers_are_the_standards(tmp_path):
    """With blanks or without."""
    plain = read_luminaire(written(tmp_path, ies_text()))
    for row, size in (("100,80,0", "0.2,0.6,0"), ("100, 80, 0", "0.2 , 0.6 , 0")):
        other = read_luminaire(written(tmp_path, ies_text(candela=((row,),), size=size)))
        np.testing.assert_array_equal(other.candela, plain.candela)
        assert other.opening == plain.opening


@examples(100)
@given(data=st.data(), text=st.sampled_from([ies_text(), "\n".join(ldt_lines())]))
def test_damaged_files_are_read_or_refused_and_nothing_else(tmp_path_factory, data, text):
    """Some bytes are replaced anywhere."""
    damaged = bytearray(text.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(1, 255))
    path = written(tmp_path_factory.mktemp("bad"), bytes(damaged))
    with suppress(UserError):
        assert np.isfinite(read_luminaire(path).flux)


def test_long_lines_of_an_ies_file_take_linear_time(tmp_path):
    begun = perf_counter()
    assert of_ies(tmp_path, header="TILT=" + " " * 200_000 + "NONE  ").flux > 0
    for text in (
        ies_text(header="TILT=a" + " " * 200_000 + "b"),
        ies_text(candela=((100, "0" * 200_000 + "1", "0,5"),)),
    ):
        (tmp_path / "lamp.ies").write_text(text)
        with pytest.raises(UserError):
            read_luminaire(tmp_path / "lamp.ies")
    assert perf_counter() - begun < 3  # quadratic: many minutes
