"""Surfaces of many poles, of which OCCT writes a span: the file is that which OCCT writes of the whole."""

import pytest

from tests.thbcad.cases import LENSES, assert_holds, one_line
from thbcad import Product, write_step
from thbcad.cad.exchange import long_surfaces
from thbcad.cad.exchange.step import part_of, part_step, product_of, read_step, step_bytes
from thbcad.io import parse_brep

REFERRING = Product("lens '#12' = (#13); CARTESIAN_POINT('',(1.,2.,3.))", author="#4", material="glass #5")
FEIGNING = Product(
    "#9=CARTESIAN_POINT(',(1000000000.,", material="#9 = CARTESIAN_POINT(',(1.,2.,3.));", density=2.5
)


@pytest.fixture
def count(monkeypatch):
    """Let surfaces of few poles pass for long, and count them."""
    counts, whole = [], long_surfaces.shortened

    def counted(part):
        found = whole(part)
        counts.extend(found)
        return found

    monkeypatch.setattr(long_surfaces, "MANY", 3)
    monkeypatch.setattr("thbcad.cad.exchange.step.shortened", counted)
    return counts


@pytest.mark.parametrize("schema", ["AP242", "AP214"])
@pytest.mark.parametrize("product", [Product(), REFERRING, FEIGNING], ids=["plain", "referring", "feigning"])
@pytest.mark.parametrize("name", LENSES)
def test_the_file_is_that_of_the_whole_surfaces(name, product, schema, count):
    lens = LENSES[name]
    whole = part_step(part_of(lens), product_of(lens, product), schema)
    assert one_line(step_bytes(lens, product, schema)) == one_line(whole)
    assert len(count) == whole.count(b"=B_SPLINE_SURFACE_WITH_KNOTS")


def test_short_surfaces_stay_beside_long_ones(count, monkeypatch):
    lens = LENSES["ruled"]
    monkeypatch.setattr(long_surfaces, "MANY", 2 * 16)  # walls have so many poles
    whole = part_step(part_of(lens), product_of(lens, None))
    assert one_line(step_bytes(lens)) == one_line(whole)
    assert len(count) == 1 < whole.count(b"=B_SPLINE_SURFACE_WITH_KNOTS")


def test_what_occt_leaves_out_or_writes_twice_is_an_error():
    lens = LENSES["freeform"]
    text = step_bytes(lens).decode("ascii")
    with pytest.raises(RuntimeError, match="OCCT wrote 0 surfaces for one"):
        long_surfaces.with_whole(text, [lens.graphs()[1]])


@pytest.mark.parametrize("name", LENSES)
def test_it_holds_the_lens_for_both_readers(name, count, tmp_path):
    write_step(LENSES[name], tmp_path / "a.step")
    assert_holds(read_step(tmp_path / "a.step"), LENSES[name])
    assert len(parse_brep(tmp_path / "a.step").faces) == 6
    lines = (tmp_path / "a.step").read_text("ascii").split("\n")
    assert max(map(len, lines)) < 256
