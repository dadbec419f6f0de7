"""Lens files and STEP files that were cut or changed are refused, or hold what their text says."""

import json
from functools import cache

import pytest
from hypothesis import given, strategies as st

from tests.cases import examples
from tests.thbcad.cases import LENSES, assert_same_surface, bits, lenses
from thbcad.cad.exchange import step_bytes
from thbcad.io import brep_of_text, image_distance, turned_faces
from thbcad.io.lens_json import lens_from_dict, lens_to_dict, read_lens, write_lens
from thbcad.lens import optical_forms
from thbcad.sags import PlacedConic

NAMES = ("table63", "freeform", "plano")
PRINTABLE = st.characters(min_codepoint=32, max_codepoint=126)


@cache
def step(name):
    return step_bytes(LENSES[name]).decode("ascii")


@cache
def native(name):
    return json.dumps(lens_to_dict(LENSES[name]), separators=(",", ":"))


def refusal(read, text):
    """Return the sentence with which a text is refused, None where it is read."""
    try:
        read(text)
    except ValueError as error:
        return str(error)
    return None


# ---- STEP ----


@pytest.mark.slow
@examples(10)
@given(lenses(conics=False))
def test_a_step_file_holds_the_lens(lens):
    solid = brep_of_text(step_bytes(lens).decode("ascii"))
    for face, surface in zip(solid.faces, optical_forms(lens)):
        if isinstance(surface, PlacedConic):
            assert bits(face.plane.ravel() + 0.0) == bits(surface.numbers + 0.0)
        else:
            assert_same_surface(face.surface, surface)
    assert (solid.unpaired, solid.gaps, solid.contradictions, turned_faces(solid)) == (0, 0, 0, 0)
    assert image_distance(solid) == (pytest.approx(0, abs=1e-12), ())


@examples(100)
@given(st.sampled_from(NAMES), st.data())
def test_a_step_file_cut_anywhere_is_refused(name, data):
    text = step(name)
    cut = text[: data.draw(st.integers(0, len(text.rstrip()) - 1))]
    with pytest.raises(ValueError, match=r"head must be|cut off"):
        brep_of_text(cut)


@examples(100)
@given(st.sampled_from(NAMES), st.data())
def test_a_changed_step_file_is_read_or_refused_with_a_sentence(name, data):
    """Characters are replaced, put in or taken out anywhere, in up to four places."""

    def read(text):
        assert brep_of_text(text).faces

    text = step(name)
    for _ in range(data.draw(st.integers(1, 4))):
        first, last = sorted(data.draw(st.integers(0, len(text))) for _ in range(2))
        last = min(last, first + data.draw(st.integers(0, 3)))
        put_in = data.draw(st.text(PRINTABLE | st.sampled_from("#'();,.*$/0 9ETA-\n\0é"), max_size=3))
        text = text[:first] + put_in + text[last:]
    sentence = refusal(read, text)
    assert sentence is None or 10 < len(sentence) < 400


# ---- lens.json ----


@examples(100)
@given(st.sampled_from(NAMES), st.data())
def test_a_lens_file_cut_anywhere_is_refused(name, data):
    text = native(name)
    with pytest.raises(json.JSONDecodeError):
        json.loads(text[: data.draw(st.integers(0, len(text) - 1))])


def plain(lens):
    """Return a lens as plain data, cells in order."""
    return ordered(json.loads(json.dumps(lens_to_dict(lens))))


def ordered(data):
    for surface in (data["front"], data["rear"]):
        if "sag" in surface:
            surface["sag"]["refined"] = [sorted(cells) for cells in surface["sag"]["refined"]]
    return data


@examples(200)
@given(st.sampled_from(NAMES), st.data())
def test_a_changed_lens_file_is_refused_or_holds_what_it_says(name, data):
    """One character is another: nothing that the file says is passed over."""
    text = native(name)
    place = data.draw(st.integers(0, len(text) - 1))
    changed = text[:place] + data.draw(PRINTABLE) + text[place + 1 :]
    sentence = refusal(lambda text: lens_from_dict(json.loads(text)), changed)
    if sentence is not None:
        assert 10 < len(sentence) < 400
        return
    said = json.loads(changed)
    assert plain(lens_from_dict(said)) == ordered(said)


@pytest.mark.parametrize(
    ("place", "key"),
    [((), "tilt"), (("front",), "sagg"), (("rear", "sag"), "weights")],
    ids=["lens", "surface", "sag"],
)
def test_a_key_that_is_not_known_is_refused(place, key):
    data = json.loads(native("freeform"))
    inner = data
    for name in place:
        inner = inner[name]
    inner[key] = 1.0
    with pytest.raises(ValueError, match=f"file has the unknown key '{key}'"):
        lens_from_dict(data)


def test_a_key_that_stands_twice_is_refused(tmp_path):
    path = tmp_path / "lens.json"
    write_lens(LENSES["plano"], path)
    assert bits(read_lens(path).thickness) == bits(5.0)
    path.write_text(path.read_text().replace('"thickness":5.0', '"thickness":5.0,"thickness":6.0'))
    with pytest.raises(ValueError, match="key 'thickness' stands twice"):
        read_lens(path)
