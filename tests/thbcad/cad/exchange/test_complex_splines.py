"""Splines as complex entities in a STEP file, with and without weights, their parts in any order."""

import random
import re

import numpy as np
import pytest

from tests.thbcad.cases import LENSES, assert_same_surface
from tests.thbcad.io.cases import rational_torus
from thbcad.cad import read_faces, read_step
from thbcad.cad.exchange import step_bytes
from thbcad.cad.exchange.reading import common_splines
from thbcad.io import parse_brep

SIMPLE = re.compile(r"=\s*(B_SPLINE_(SURFACE|CURVE))_WITH_KNOTS\('',((?:[^;])*?\.[TFU]\.)(,\(\d[^;]*)\);")
COMPLEX = re.compile(r"=\s*\((\s*BOUNDED_(?:SURFACE|CURVE)\s*\(.*?)\)\s*;", re.DOTALL)
PART = re.compile(r"[A-Z_]+\((?:[^()']|'[^']*'|\((?:[^()]|\([^()]*\))*\))*\)")
LENS = step_bytes(LENSES["table63"]).decode()


def complex_text(text, order):
    """Return a file whose simple splines are complex entities: the parts `order`ed, a list to a list."""

    def entity(found):
        base, what, shape, knots = found.groups()
        parts = [
            f"BOUNDED_{what}()",
            f"{base}({shape})",
            f"{base}_WITH_KNOTS({knots[1:]})",
            f"{'CURVE' if what == 'CURVE' else 'SURFACE'}()",
            "GEOMETRIC_REPRESENTATION_ITEM()",
            "REPRESENTATION_ITEM('')",
        ]
        return f"=({' '.join(order(parts))});"

    return SIMPLE.sub(entity, text)


def shuffled(seed):
    return lambda parts: random.Random(seed).sample(parts, len(parts))


@pytest.mark.parametrize("order", [sorted, shuffled(1), shuffled(2)], ids=["sorted", "1", "2"])
def test_a_lens_of_complex_splines_without_weights_is_read_as_the_simple_ones_are(order, tmp_path):
    text = complex_text(LENS, order)
    assert "BOUNDED_SURFACE()" in text
    assert "=B_SPLINE_SURFACE" not in text
    path = tmp_path / "lens.step"
    path.write_text(text)
    plain = tmp_path / "plain.step"
    plain.write_text(LENS)
    read, own = read_step(path), read_step(plain)
    assert_same_surface(read.front, own.front)
    assert_same_surface(read.rear, own.rear)
    assert read.face_names == own.face_names
    for face, same in zip(parse_brep(path).faces, parse_brep(plain).faces, strict=True):
        assert (face.surface is None) == (same.surface is None)


@pytest.mark.parametrize("seed", range(3))
def test_weights_are_read_with_the_parts_in_any_order(seed, tmp_path):
    path = rational_torus(tmp_path / "torus.step")
    text = path.read_text()
    other = tmp_path / "other.step"
    order = shuffled(seed)
    changed = COMPLEX.sub(lambda m: f"=({' '.join(order(PART.findall(m[1])))});", text)
    assert changed != text
    other.write_text(changed)
    for a, b in zip(read_faces(other), read_faces(path), strict=True):
        assert type(a) is type(b)
        for name in ("coefficients", "weights") if hasattr(a, "weights") else ("coefficients",):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_a_file_that_occt_can_read_keeps_its_bytes(tmp_path):
    path = rational_torus(tmp_path / "torus.step")
    for data in (LENS.encode(), path.read_bytes()):
        assert common_splines(data) == data


def test_words_in_strings_and_comments_are_no_splines():
    within = "'#9=(B_SPLINE_CURVE() B_SPLINE_CURVE_WITH_KNOTS());'"
    text = f"ISO-10303-21;HEADER;FILE_NAME({within});ENDSEC;DATA;#1=A({within});ENDSEC;END-ISO-10303-21;"
    assert common_splines(text.encode()) == text.encode()


def test_a_damaged_complex_spline_stays_as_it_is():
    text = "ISO-10303-21;HEADER;ENDSEC;DATA;#1=(B_SPLINE_CURVE(1 B_SPLINE_CURVE_WITH_KNOTS();ENDSEC;"
    assert common_splines(text.encode()) == text.encode()
