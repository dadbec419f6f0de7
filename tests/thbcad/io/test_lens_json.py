"""The native lens file: bit-identical round trips, damaged files, atomic writing."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given

from tests.cases import ROOT
from tests.thbcad.cases import AWKWARD, bits, lenses
from thbcad.hierarchy import THBSpace
from thbcad.io import atomic_files as files
from thbcad.io.lens_json import (
    lens_from_dict,
    lens_to_dict,
    read_lens,
    sag_from_dict,
    sag_to_dict,
    write_lens,
)
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

# what a message for people does not hold: the interpreter's own words
INTERNAL = re.compile(r'Traceback|File "|__\w+__|object at 0x|<class|ufunc|positional argument|\n')


def example():
    space = THBSpace(KnotVector.uniform(3, 4), KnotVector(2, [0, 0, 0, 1 / 3, 1, 1, 1])).refine(
        {0: [(0, 0), (1, 0), (0, 1), (1, 1)]}
    )
    sag = THBSurface(space, np.resize(AWKWARD, space.dim))
    return Lens(FreeformSurface((5, 4)), FreeformSurface((6, 4), Conic(-90.0, -1.0), sag), 12.0, 1.49)


DIM = example().rear.sag.space.dim


@pytest.fixture
def path(tmp_path):
    return tmp_path / "lens.json"


def assert_same(a, b):
    assert bits([a.thickness, a.index]) == bits([b.thickness, b.index])
    for one, two in ((a.front, b.front), (a.rear, b.rear)):
        assert bits(one.half_width) == bits(two.half_width)
        assert bits([one.conic.radius, one.conic.constant]) == bits([two.conic.radius, two.conic.constant])
        assert (one.sag is None) == (two.sag is None)
        if one.sag is None:
            continue
        for s, t in ((one.sag.space.kv_u, two.sag.space.kv_u), (one.sag.space.kv_v, two.sag.space.kv_v)):
            assert s.degree == t.degree
            assert bits(s.knots) == bits(t.knots)
        assert (one.sag.space.cells == two.sag.space.cells).all()
        assert (one.sag.space.functions == two.sag.space.functions).all()
        assert bits(one.sag.coefficients) == bits(two.sag.coefficients)


# ---- round trips ----


@given(lenses(conics=False))
def test_round_trip_is_bit_identical(lens):
    text = json.dumps(lens_to_dict(lens), allow_nan=False)
    again = lens_from_dict(json.loads(text))
    assert_same(lens, again)
    assert json.dumps(lens_to_dict(again)) == text


def test_round_trip_through_a_file(path):
    lens = example()
    write_lens(lens, path)
    again = read_lens(path)
    assert_same(lens, again)
    assert np.isinf(again.front.conic.radius)
    first = path.read_bytes()
    write_lens(again, path)
    assert path.read_bytes() == first
    assert b"NaN" not in first
    assert b"Infinity" not in first


def test_numpy_numbers_are_written(path):
    """What a lens accepts, its file accepts."""
    lens = Lens(
        FreeformSurface((5, 4)),
        FreeformSurface((5, 4), Conic(np.float32(40), np.int64(-1))),
        np.int64(3),
        np.float32(1.5),
    )
    write_lens(lens, path)
    assert_same(read_lens(path), lens)


def test_sag_round_trip():
    sag = example().rear.sag
    again = sag_from_dict(json.loads(json.dumps(sag_to_dict(sag))))
    assert bits(again.coefficients) == bits(sag.coefficients)
    assert (again.space.cells == sag.space.cells).all()


# ---- damaged files ----


def assert_refused(path, message="", kind=ValueError):
    """One sentence without the interpreter's own words."""
    with pytest.raises(kind) as caught:
        read_lens(path)
    text = str(caught.value)
    assert re.search(message, text)
    assert text
    assert not INTERNAL.search(text)


@pytest.mark.parametrize(
    "data",
    [
        b"\xff\xfe\x00",
        b"ISO-10303-21;\n",
        b"\x00" * 100,
        b"{",
        b'{"schema": "thbcad-lens", "version": 1,}',
        b'{"schema"\n:\n',
    ],
)
def test_files_that_are_no_json_are_refused(path, data):
    path.write_bytes(data)
    assert_refused(path, "is not a lens file")


@pytest.mark.parametrize(
    "text", ["[]", "null", "1", '"thbcad-lens"', "{}", '{"schema": "other"}', '{"schema": ["thbcad-lens"]}']
)
def test_other_schemas_are_refused(path, text):
    path.write_text(text)
    assert_refused(path, "not a lens file: its schema is not 'thbcad-lens'")


@pytest.mark.parametrize("version", [0, 2, "1", None, 1.5, [1], True, KeyError])
def test_other_versions_are_refused(path, version):
    path.write_text(json.dumps(changed(("version",), version)))
    assert_refused(path, r"lens file version .* is unknown, this program reads version 1")


@pytest.mark.parametrize("units", ["inch", None, 1, KeyError])
def test_other_units_are_refused(path, units):
    path.write_text(json.dumps(changed(("units",), units)))
    assert_refused(path, r"lens file's units must be 'mm', got ('inch'|None|1)")


def changed(keys, value):
    """Return the example as data in which the entry at `keys` is `value`, or missing for KeyError."""
    data = json.loads(json.dumps(lens_to_dict(example())))
    inner = data
    for key in keys[:-1]:
        inner = inner[key]
    if value is KeyError:
        del inner[keys[-1]]
    else:
        inner[keys[-1]] = value
    return data


@pytest.mark.parametrize(
    "keys",
    [
        *((key,) for key in ("index", "thickness", "front", "rear")),
        *(("front", key) for key in ("half_width", "radius", "conic")),
        *(("rear", "sag", key) for key in ("degree", "knots", "refined", "coefficients")),
    ],
    ids=".".join,
)
def test_missing_keys_are_named(path, keys):
    path.write_text(json.dumps(changed(keys, KeyError)))
    assert_refused(path, f"lacks the key '{keys[-1]}'")


WRONG = [
    (("index",), [1.5]),
    (("index",), None),
    (("index",), "1.5"),
    (("index",), float("nan")),
    (("index",), 10**400),
    (("thickness",), {}),
    (("thickness",), "thick"),
    (("thickness",), float("inf")),
    (("thickness",), True),
    (("front",), None),
    (("front",), [1, 2]),
    (("front",), "plane"),
    (("front", "half_width"), 5),
    (("front", "half_width"), [5]),
    (("front", "half_width"), "55"),
    (("front", "half_width"), [5, None]),
    (("front", "half_width"), [5, float("nan")]),
    (("front", "radius"), "inf"),
    (("front", "radius"), 0),
    (("front", "radius"), float("nan")),
    (("front", "conic"), None),
    (("front", "conic"), float("nan")),
    (("rear", "sag"), None),
    (("rear", "sag"), []),
    (("rear", "sag", "degree"), 3),
    (("rear", "sag", "degree"), [3]),
    (("rear", "sag", "degree"), [3, 2, 1]),
    (("rear", "sag", "degree"), [3.0, 2.0]),
    (("rear", "sag", "degree"), ["3", "2"]),
    (("rear", "sag", "knots"), [[0, 0, 0, 0, 1, 1, 1, 1]]),
    (("rear", "sag", "knots"), "knots"),
    (("rear", "sag", "knots"), [None, None]),
    (("rear", "sag", "refined"), 5),
    (("rear", "sag", "refined"), [None]),
    (("rear", "sag", "refined"), [[[0.0, 0.0]]]),
    (("rear", "sag", "refined"), [[[0, 99]]]),
    (("rear", "sag", "refined"), [[], [[0, 0]]]),
    (("rear", "sag", "refined"), [[[10**30, 0]]]),
    (("rear", "sag", "refined"), [[[0, 0]]] * 40),
    (("rear", "sag", "coefficients"), {}),
    (("rear", "sag", "coefficients"), [1.0]),
    (("rear", "sag", "coefficients"), ["1"] * DIM),
    (("rear", "sag", "coefficients"), [None] * DIM),
    (("rear", "sag", "coefficients"), [[0.0]] * DIM),
    (("rear", "sag", "coefficients"), [float("nan")] * DIM),
    (("rear", "sag", "coefficients"), [10**400] * DIM),
]


@pytest.mark.parametrize(
    ("keys", "value"), WRONG, ids=lambda x: ".".join(x) if isinstance(x, tuple) else repr(x)[:20]
)
def test_wrong_types_and_numbers_are_refused(path, keys, value):
    path.write_text(json.dumps(changed(keys, value)))
    assert_refused(path)


def test_deeply_nested_files_are_refused(path):
    path.write_text("[" * 100_000)
    assert_refused(path)


def test_sizes_are_checked_before_memory_is_taken(path):
    """Knots for 200,000 x 200,000 cells with four coefficients: an error, not 40 GB."""
    knots = [0.0, *range(200_001), 200_000.0]
    sag = {"degree": [1, 1], "knots": [knots, knots], "refined": [], "coefficients": [0.0] * 4}
    path.write_text(json.dumps(changed(("rear", "sag"), sag)))
    program = """
import resource, sys
from thbcad import read_lens
resource.setrlimit(resource.RLIMIT_AS, (4 * 2**30, 4 * 2**30))
try:
    read_lens(sys.argv[1])
except ValueError as error:
    print("refused", error)
"""
    one_thread = os.environ | {"OPENBLAS_NUM_THREADS": "1"}  # every thread reserves address space
    command = [sys.executable, "-c", program, str(path)]
    done = subprocess.run(command, cwd=ROOT, env=one_thread, capture_output=True, text=True, check=False)
    assert done.stdout.startswith("refused"), done.stderr[-300:]


def test_missing_files_are_os_errors(path, tmp_path):
    for place in (path, tmp_path):
        with pytest.raises(OSError, match=re.escape(str(place))):
            read_lens(place)


# ---- atomic writing ----


FULL = OSError(28, "No space left on device")


@pytest.mark.parametrize(
    ("failing", "error"),
    [("replace", FULL), ("fsync", FULL), ("chmod", FULL), ("replace", KeyboardInterrupt())],
)
def test_a_write_that_fails_or_is_interrupted_leaves_the_old_file(path, monkeypatch, failing, error):
    path.write_text("old")

    def fail(*arguments):
        raise error

    monkeypatch.setattr(files.os, failing, fail)
    with pytest.raises(type(error)):
        write_lens(example(), path)
    monkeypatch.undo()
    assert path.read_text() == "old"
    assert os.listdir(path.parent) == ["lens.json"]


def test_a_write_leaves_one_file_with_the_usual_rights(path):
    path.write_text("old")
    write_lens(example(), path)
    assert os.listdir(path.parent) == ["lens.json"]
    other = path.parent / "other"
    other.touch()
    assert path.stat().st_mode == other.stat().st_mode


def test_a_missing_folder_is_an_os_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        write_lens(example(), tmp_path / "nowhere" / "lens.json")
