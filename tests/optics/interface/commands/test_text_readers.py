"""Every reader of text takes the same numbers from every encoding and every kind of line end."""

import os
import re
import threading
from argparse import Namespace

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.interface.commands.tolerance_amounts import amounts_of
from optics.light.roads import read_r_table
from optics.scene.luminaires import read_luminaire
from optics.scene.problem import load_problem
from optics.scene.ray_files import read_rays
from optics.tolerancing.metrology import read_measured
from tests.cases import EXAMPLES
from tests.optics.scene.luminaires.cases import ies_text, ldt_lines
from tests.optics.tolerancing.metrology.cases import freeform, scattered
from thbcad import files
from thbcad.io import sag_text
from thbcad.mounts import read_mount

SURFACE = freeform()
X, Y = scattered(120)
POINTS = "# Pr\u00fcfling\nx y z\n" + "\n".join(
    f"{x!r} {y!r} {z!r}" for x, y, z in zip(X.tolist(), Y.tolist(), SURFACE(X, Y).tolist())
)
RAYS = "# Lichtst\u00e4rke\nx y z l m n flux\n0 0.5 0 0.6 0 0.8 1.5\n1 2 3 0 0 1 0.25\n"
ROAD = "\n".join(
    " ".join(f"{300 / (1 + row) + column * (row > 0):.1f}" for column in range(20)) for row in range(29)
)
MOUNT = "wall = 0.5  # d\u00fcnn\n[flange]\nthickness = 2.0\nsize = [30.0, 28.0]\n"


def luminaire(path):
    light = read_luminaire(path)
    return [*light.candela.ravel(), *light.planes, *light.gammas, *light.opening.size]


def rays(path):
    read = read_rays(path)
    return np.column_stack([read.position, read.direction, read.flux]).ravel()


def measured(path):
    return read_measured(path, SURFACE).points.ravel()


def tolerances(path):
    return amounts_of(Namespace(tolerances=str(path), set=[])).tolerances.values()


def problem(path):
    read = load_problem(path)
    return [read.lens.index, read.lens.thickness, *read.source.half_width, *read.target.half_width]


def mount(path):
    flange = read_mount(path).flange
    return [flange.thickness, *flange.size]


READERS = {
    "IES": (luminaire, ies_text(header="[MANUFAC] Stra\u00dfe\nTILT=NONE")),
    "EULUMDAT": (luminaire, "\n".join(["Lichtst\u00e4rke", *ldt_lines()[1:]])),
    "rays": (rays, RAYS),
    "measured points": (measured, POINTS),
    "grid sag": (measured, sag_text(SURFACE, (12, 11)).decode()),
    "r-table": (lambda path: read_r_table(path).r.ravel(), ROAD),
    "tolerances": (tolerances, "# \u00b5m\n[lens]\ndecentre = 0.02\ntilt_x = 0.5\n"),
    "mount": (mount, MOUNT),
    "problem": (problem, (EXAMPLES / "tophat_square.toml").read_text("utf-8") + "# Stra\u00dfe\n"),
}
OF_TOML = ("tolerances", "mount", "problem")
FORMS = {
    "a byte order mark": lambda text: text.encode("utf-8-sig"),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16, big end first": lambda text: b"\xfe\xff" + text.encode("utf-16-be"),
    "UTF-16 without a mark": lambda text: text.encode("utf-16-le"),
    "CR LF": lambda text: text.replace("\n", "\r\n").encode(),
    "CR": lambda text: text.replace("\n", "\r").encode(),
    "CR CR LF": lambda text: text.replace("\n", "\r\r\n").encode(),
    "trailing blanks and tabs": lambda text: text.replace("\n", " \t \n").encode(),
    "the end byte of DOS": lambda text: text.replace("\n", "\r\n").encode() + b"\r\n\x1a",
    "a block filled with end bytes": lambda text: text.encode() + b"\n" + b"\x1a" * 100,
    "all of them": lambda text: (text.replace("\n", " \t\r\n") + "\r\n\x1a").encode("utf-16"),
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", READERS)
def test_every_reader_takes_the_same_numbers_from_every_form(tmp_path, name, form):
    read, text = READERS[name]
    plain, other = tmp_path / "plain.file", tmp_path / "other.file"
    plain.write_bytes(text.encode())
    other.write_bytes(FORMS[form](text))
    numbers = np.array([*read(plain)], dtype=float)
    assert numbers.size > 1
    np.testing.assert_array_equal(np.array([*read(other)], dtype=float), numbers)


@pytest.mark.parametrize("name", READERS)
def test_latin_1_is_read_where_the_format_allows_it_and_refused_by_line_elsewhere(tmp_path, name):
    read, text = READERS[name]
    plain, latin = tmp_path / "plain.file", tmp_path / "latin.file"
    plain.write_bytes(text.encode())
    latin.write_bytes(text.encode("latin-1"))
    if name not in OF_TOML:
        np.testing.assert_array_equal([*read(latin)], [*read(plain)])
        return
    with pytest.raises(
        (UserError, ValueError), match=r"not UTF-8 text: line \d+ holds the byte 0x"
    ) as caught:
        read(latin)
    assert "latin.file" in str(caught.value)


DECIMAL = re.compile(r"(?<![\w.:-])-?\d+\.\d+(?:e[-+]\d+)?(?![\w.])")


def with_commas(text):
    """Return rows of a table with decimal commas, apart by tabs."""
    rows = [
        line if line[:1] in "#x" else line.replace(".", ",").replace(" ", "\t") for line in text.split("\n")
    ]
    return "\n".join(rows)


@pytest.mark.parametrize("name", ["rays", "measured points", "grid sag", "r-table", "EULUMDAT"])
def test_decimal_commas_between_tabs_are_read(tmp_path, name):
    read, text = READERS[name]
    plain, commas = tmp_path / "plain.file", tmp_path / "commas.file"
    plain.write_text(text, "utf-8")
    commas.write_text(with_commas(text), "utf-8")
    np.testing.assert_array_equal([*read(commas)], [*read(plain)])


@pytest.mark.parametrize("name", ["rays", "measured points", "r-table"])
def test_commas_that_may_part_columns_or_mark_decimals_are_refused_by_name(tmp_path, name):
    read, text = READERS[name]
    path = tmp_path / "a.file"
    path.write_text(
        "\n".join(row for row in with_commas(text).replace("\t", ",").split("\n") if "#" not in row), "utf-8"
    )
    with pytest.raises(UserError, match=r"a\.file.* it has commas .* such as '.*,.*'; write decimal points"):
        read(path)


@pytest.mark.parametrize("name", ["rays", "measured points", "grid sag", "r-table", "IES", "EULUMDAT"])
@pytest.mark.parametrize("exponent", ["E", "D", "d"])
def test_fortran_exponents_are_read(tmp_path, name, exponent):
    read, text = READERS[name]
    plain, other = tmp_path / "plain.file", tmp_path / "fortran.file"
    plain.write_text(text, "utf-8")
    other.write_text(DECIMAL.sub(lambda word: f"{float(word[0]):.17e}".replace("e", exponent), text), "utf-8")
    assert f"{exponent}+0" in other.read_text("utf-8") or f"{exponent}-0" in other.read_text("utf-8")
    np.testing.assert_array_equal([*read(other)], [*read(plain)])


@pytest.mark.parametrize("word", ["4_5.0", "\u0664\u0665", "\uff11", "0x10", "1e"])
@pytest.mark.parametrize("name", ["rays", "measured points", "r-table", "IES", "EULUMDAT"])
def test_odd_digits_are_refused_in_a_sentence(tmp_path, name, word):
    read, text = READERS[name]
    path = tmp_path / "odd.file"
    head, _, last = text.strip().rpartition("\n")
    path.write_text(f"{head}\n{word} {last.partition(' ')[2]}\n", "utf-8")
    with pytest.raises(UserError, match=r"odd\.file") as caught:
        read(path)
    assert word in str(caught.value) or ascii(word)[1:-1] in str(caught.value)


@pytest.mark.parametrize("name", ["measured points", "tolerances", "mount"])
def test_what_is_read_once_may_come_from_a_pipe(tmp_path, name):
    read, text = READERS[name]
    plain, pipe = tmp_path / "plain.file", tmp_path / "pipe"
    plain.write_text(text, "utf-8")
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=[text.encode()])
    writer.start()
    found = [*read(pipe)]
    writer.join()
    np.testing.assert_array_equal(np.array(found, dtype=float), np.array([*read(plain)], dtype=float))


@pytest.mark.parametrize("name", READERS)
def test_a_pipe_without_a_writer_is_never_waited_for(tmp_path, name, monkeypatch):
    monkeypatch.setattr(files, "PATIENCE", 0.1)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises((UserError, OSError), match="it is a pipe"):
        READERS[name][0](pipe)
