"""STEP files written otherwise are accepted, damaged ones are rejected: by their text, and all in all."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.exchange.verification.independent_checks import text_and_occt_checks, text_checks
from optics.exchange.verification.lone_file import WITHOUT_LENS, bare_checks, text_checks_of
from optics.exchange.verification.same_design import OTHER_TEXT, fresh_export_checks, same_checks
from optics.exchange.verification.step_checks import verify
from optics.exchange.verification.step_file import StepFile
from optics.scene.system import System, designed_part
from tests.cases import examples
from tests.optics.cases import failing
from tests.optics.exchange.verification.cases import SPLINES, shaped
from tests.optics.exchange.verification.changed_texts import CORRUPTIONS, REAL, REWRITES
from thbcad.cad.exchange import part_step, step_bytes
from thbcad.cad.shapes import trimmed_part
from thbcad.io import brep_of_text
from thbcad.lens import FreeformSurface, Lens, Product
from thbcad.sags import Conic

NAMES = {
    "lens.material": "PMMA; 'clear'",
    "lens.density": 1.19,
    "export.product": "a lens; #1",
    "export.author": "A. Uthor",
}


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A lens, its system, the text of its STEP file, and the solid that the text holds."""
    problem, lens = shaped(tmp_path_factory.mktemp("texts"), NAMES | SPLINES)
    system = System(problem).with_lens(lens)
    text = step_bytes(lens, system.product).decode("ascii")
    return SimpleNamespace(system=system, lens=lens, text=text, solid=brep_of_text(text))


def failed_by_text(good, text):
    """Return the checks of a folder that fail, without OCCT and without rays."""
    solid = brep_of_text(text)
    return failing([*same_checks(solid, good.solid), *text_checks(solid, good.lens)])


def test_the_lists_are_long_enough():
    assert len(CORRUPTIONS) >= 40
    assert len(REWRITES) >= 20


@pytest.mark.every(6)
@pytest.mark.parametrize("name", REWRITES)
def test_a_file_written_otherwise_passes(good, name):
    text = REWRITES[name](good.text, np.random.default_rng(1))
    assert text != good.text
    assert failed_by_text(good, text) == []
    assert failing(text_checks_of(brep_of_text(text)).checks) == []


@pytest.mark.every(3)
@pytest.mark.parametrize("name", CORRUPTIONS)
def test_a_damaged_file_is_rejected(good, name):
    """With its lens always; by itself where the second entry says so."""
    damage, alone = CORRUPTIONS[name]
    text = damage(good.text)
    assert text != good.text
    try:
        solid = brep_of_text(text)
    except ValueError:
        assert alone
        return
    assert failed_by_text(good, text) != []
    assert bool(failing(text_checks_of(solid).checks)) == alone


@examples(60)
@given(st.data())
def test_every_number_of_the_solid_counts(good, data):
    """A real of a point, a vector or a knot, or a ratio of a direction, is another by 1e-9: it is seen."""
    first = good.text.index("MANIFOLD_SOLID_BREP")
    last = good.text.index("UNCERTAINTY_MEASURE_WITH_UNIT")
    # only the ratios of a direction count: one along an axis that is longer means the same
    counted = re.sub(r"DIRECTION[^;]*;", lambda m: m[0].replace("1.", "##"), good.text)
    reals = [m for m in re.finditer(rf"(?<=[(,\n]){REAL}(?=[,)])", counted) if first < m.start() < last]
    place = reals[data.draw(st.integers(0, len(reals) - 1))]
    other = float(place[0]) + data.draw(st.sampled_from([-1e-9, 1e-9]))
    text = good.text[: place.start()] + f"{other:#.17G}" + good.text[place.end() :]
    try:
        solid = brep_of_text(text)
    except ValueError:
        return
    assert failing(same_checks(solid, good.solid)) == [
        "text of the file: faces and edges that differ from a fresh export of the lens"
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", REWRITES)
def test_a_file_written_otherwise_passes_every_check(good, tmp_path, backend, name):
    file = StepFile(tmp_path / "lens.step")
    file.path.write_bytes(REWRITES[name](good.text, np.random.default_rng(1)).encode("ascii"))
    checks, notes = fresh_export_checks(designed_part(good.system), "AP242", file)
    checks += text_and_occt_checks(good.system, file, backend)
    checks += verify(good.system, file, backend)
    assert failing([*checks, *bare_checks(file).checks]) == []
    assert notes == [OTHER_TEXT]


def test_a_file_as_it_was_written_needs_no_note(good, tmp_path):
    file = StepFile(tmp_path / "lens.step")
    file.path.write_text(good.text)
    checks, notes = fresh_export_checks(designed_part(good.system), "AP242", file)
    assert (failing(checks), notes) == ([], [])


@pytest.mark.filterwarnings("error")
def test_a_volume_that_is_not_found_fails(good, tmp_path):
    """Numbers too large for the quadrature were a reason to leave it out."""
    damage, _ = CORRUPTIONS["a pole at z = 1e8"]
    (tmp_path / "lens.step").write_text(damage(good.text))
    checks, left_out = bare_checks(StepFile(tmp_path / "lens.step"))
    names = {"volume", "area"}
    assert {c.name.split()[0] for c in checks if "quadrature" in c.name} == names
    assert "area by OCCT against quadrature over the text of the file, relative" in failing(checks)
    assert left_out == [WITHOUT_LENS]


def test_the_area_of_a_hyperboloid_is_found_more_finely(tmp_path):
    """By the tolerance of other faces OCCT's area of it is off by 1e-5."""
    side = (24.0, 24.0)
    lens = Lens(FreeformSurface(side), FreeformSurface(side, Conic(-25.0, -2.25)), 22.0, 1.5)
    (tmp_path / "lens.step").write_bytes(step_bytes(lens, Product("steep")))
    checks, _ = bare_checks(StepFile(tmp_path / "lens.step"))
    assert failing(checks) == []


def test_what_is_left_out_of_a_cut_lens_is_said(good, tmp_path):
    part = trimmed_part(good.lens, (5.0, 4.0))
    (tmp_path / "lens.step").write_bytes(part_step(part, good.system.product))
    checks, left_out = bare_checks(StepFile(tmp_path / "lens.step"))
    assert failing(checks) == []
    (by_text,) = (check for check in checks if "quadrature" in check.name)
    assert by_text.name.startswith("volume by OCCT")
    assert by_text.value < 1e-9
    starts = (
        "crossings of front and rear",
        "area by OCCT: its integral over the wall of an ellipse",
        "whether the lens is the one that was designed",
    )
    assert all(sentence.startswith(start) for sentence, start in zip(left_out, starts, strict=True))


def test_a_lone_file_says_what_only_its_folder_can_say(good, tmp_path):
    (tmp_path / "lens.step").write_text(good.text)
    assert bare_checks(StepFile(tmp_path / "lens.step")).left_out == [WITHOUT_LENS]
