"""What a problem leaves to the material of its lens."""

import numpy as np
import pytest

from optics.light.analysis import coloured
from optics.scene.materials import MATERIALS
from optics.scene.paths import Medium
from optics.scene.photometry import spectral_lines
from optics.scene.problem import Problem, load_problem
from optics.scene.system import load_system
from tests.optics.cases import alone, write_problem
from tests.optics.scene.problem.cases import load_text, refusal

PMMA = {"lens.material": "PMMA"}


def system_of(folder, changes):
    """Return the system of the small problem with changes; it has no index of its own."""
    drop = () if "lens.index" in changes else ("lens.index",)
    return load_system(write_problem(folder, changes, drop=drop))


def test_the_index_of_a_material_becomes_a_number(tmp_path):
    lens = system_of(tmp_path, PMMA | {"source.wavelength": 589.3}).problem.lens
    assert lens.index == pytest.approx(MATERIALS["PMMA"].index(589.3), abs=5e-7)
    assert lens.density == 1.19
    assert lens.absorption == 0


def test_an_index_that_is_given_wins(tmp_path):
    system = system_of(tmp_path, PMMA | {"lens.index": 1.495})
    assert (system.problem.lens.index, system.problem.lens.density) == (1.495, 0.0)
    assert system.material is None
    label = system_of(tmp_path, {"lens.material": "the green one", "lens.index": 1.5})
    assert label.problem.lens.index == 1.5


def test_a_density_that_is_given_stays(tmp_path):
    assert system_of(tmp_path, PMMA | {"lens.density": 1.18}).problem.lens.density == 1.18


def test_a_lens_knows_its_material(tmp_path):
    assert system_of(tmp_path, PMMA).material is MATERIALS["PMMA"]
    assert system_of(tmp_path, PMMA | {"lens.index": 1.494284}).material is MATERIALS["PMMA"]
    assert system_of(tmp_path, PMMA | {"source.wavelength": 2e4, "lens.index": 1.4}).material is None


def test_a_resolved_problem_resolves_to_itself(tmp_path):
    """Its index, tables and wavelengths are the same, so that a result can be run again."""
    changes = {"lens.material": "N-BK7", "lens.absorption": "auto", "source.spectrum": "LED-B2"}
    first = system_of(tmp_path, changes)
    (tmp_path / "again.toml").write_text(first.problem.to_toml(), "utf-8")
    again = load_system(tmp_path / "again.toml")
    assert again.problem == first.problem
    assert again.wavelengths == first.wavelengths


def test_one_wavelength_is_that_of_the_design(tmp_path):
    (wavelength,) = system_of(tmp_path, {"lens.index": 1.5}).wavelengths
    assert (wavelength.nm, wavelength.weight, wavelength.media[1]) == (550, 1, Medium(1.5))


def test_wavelengths_have_the_dispersion_of_the_material(tmp_path):
    system = system_of(tmp_path, {"lens.material": "PC", "source.spectrum": "LED-B1"})
    lines = spectral_lines("LED-B1")
    assert [(w.nm, w.weight, w.xyz) for w in system.wavelengths] == [(x.nm, x.weight, x.xyz) for x in lines]
    wanted = [MATERIALS["PC"].index(line.nm) for line in lines]
    assert [w.media[1].index for w in system.wavelengths] == pytest.approx(wanted, abs=5e-7)


def test_the_dispersion_of_a_material_goes_through_a_given_index(tmp_path):
    changes = PMMA | {"lens.index": 1.493, "source.spectrum": [[450, 1], [550, 1], [650, 1]]}
    blue, green, red = (w.media[1].index for w in system_of(tmp_path, changes).wavelengths)
    law = MATERIALS["PMMA"].index
    assert green == 1.493
    assert (blue - green, green - red) == pytest.approx((law(450) - law(550), law(550) - law(650)), abs=1e-15)


def test_a_table_of_indices_tells_all(tmp_path):
    table = [[450.0, 1.51], [650.0, 1.49]]
    system = system_of(tmp_path, {"lens.indices": table, "source.spectrum": [[450, 1], [500, 1], [650, 2]]})
    b = (1.51 - 1.49) / (450.0**-2 - 650.0**-2)
    assert system.problem.lens.index == pytest.approx(1.49 + b * (550.0**-2 - 650.0**-2), abs=5e-7)
    assert [w.media[1].index for w in system.wavelengths] == pytest.approx(
        [1.51, 1.49 + b * (500.0**-2 - 650.0**-2), 1.49], abs=1e-12
    )


def test_absorption_of_a_material_by_wavelength(tmp_path):
    changes = {"lens.material": "N-BK7", "lens.absorption": "auto", "source.spectrum": [[400, 1], [650, 1]]}
    system = system_of(tmp_path, changes)
    law = MATERIALS["N-BK7"].absorption
    assert system.path.media[1].absorption == pytest.approx(law(550), rel=1e-3)
    media = [w.media[1] for w in system.wavelengths]
    assert [m.absorption for m in media] == pytest.approx([law(400), law(650)], rel=1e-3)
    assert [path.media[1] for _, path in coloured(system, system.path)] == media
    one = alone(system, system.wavelengths[0])
    assert one.path.media[1] == media[0]
    assert not one.spectral


BAD = [
    ({}, "the key lens.index is missing"),
    ({"lens.material": "unobtainium"}, "no material 'unobtainium' is known; give lens.index as a number"),
    (PMMA | {"source.wavelength": 300.0}, "the index of PMMA is known from 380 to 1620 nm, not at 300 nm"),
    (PMMA | {"lens.absorption": "auto"}, "no absorption of PMMA is known at 550 nm"),
    (PMMA | {"lens.absorption": -1.0}, "lens.absorption must be at least 0, got -1"),
    (PMMA | {"lens.absorption": np.nan}, "lens.absorption must be a finite number"),
    (PMMA | {"lens.absorption": "much"}, 'lens.absorption must be a number or "auto"'),
    (PMMA | {"lens.index": "much"}, 'lens.index must be a number or "auto"'),
    ({"lens.indices": [[500.0, 1.5], [540.0, 1.49]]}, "lens.indices is known from 500 to 540 nm, not at 550"),
    ({"lens.indices": [[500.0, 1.0]]}, "lens.indices[0][1] must be from 1.000001 to 10, got 1"),
    ({"lens.indices": [[0.0, 1.5]]}, "lens.indices[0][0] must be a wavelength from 1 to 1e+06 nm, got 0"),
    ({"lens.indices": [[500.0, 1.5], [500.0, 1.4]]}, "lens.indices has several rows for 500 nm; keep one"),
    ({"lens.indices": 1.5}, "lens.indices must be a list of rows of 2 numbers, got 1.5"),
    ({"lens.indices": [1.5]}, "lens.indices[0] must be a list of 2 numbers, got 1.5"),
    (PMMA | {"lens.absorptions": [[500.0, -1.0]]}, "lens.absorptions[0][1] must be from 0 to 1000, got -1"),
    (PMMA | {"lens.absorptions": [[500.0, 1.0]]}, "lens.absorptions is known from 500 to 500 nm"),
    (PMMA | {"source.spectrum": "D50"}, "source.spectrum must be one of 'A', 'D65'"),
    (PMMA | {"source.spectrum": 5}, "source.spectrum must be a list of rows of 2 numbers, got 5"),
    (PMMA | {"source.spectrum": [[500, 1, 2]]}, "source.spectrum[0] must be a list of 2 numbers"),
    (PMMA | {"source.spectrum": [["blue", 1]]}, "source.spectrum[0][0] must be a number, got 'blue'"),
    (PMMA | {"source.spectrum": [[500, np.inf]]}, "source.spectrum[0][1] must be a finite number"),
    (PMMA | {"source.spectrum": [[500, -1]]}, "source.spectrum[0][1] must be from 0 to"),
    (PMMA | {"source.spectrum": [[500, 0], [600, 0]]}, "source.spectrum is dark: every weight is 0"),
    (PMMA | {"source.spectrum": [[500, 1]] * 10_001}, "list of rows of 2 numbers, at most 10000"),
    (PMMA | {"source.spectrum": [[250, 1], [500, 1]]}, "the index of PMMA is known from 380"),
    (
        {"lens.index": 1.5, "lens.material": "mine", "source.spectrum": "A"},
        "source.spectrum needs the index at 393.6 nm too, but lens.index is one number: name a known",
    ),
]


@pytest.mark.parametrize(("changes", "message"), BAD)
def test_what_cannot_be_is_one_sentence(tmp_path, changes, message):
    assert message in refusal(system_of, tmp_path, changes)


@pytest.mark.parametrize("value", ["LED-B1", [[450, 1.0], [650.0, 2]], [], ()])
def test_a_spectrum_survives_the_text_of_a_problem(tmp_path, value):
    problem = load_problem(write_problem(tmp_path)).with_(**{"source.spectrum": value})
    assert load_text(tmp_path, problem.to_toml()).source == problem.source


def test_a_notebook_shows_what_the_lens_is_made_of(tmp_path):
    problem = load_problem(write_problem(tmp_path, PMMA, drop=("lens.index",)))
    assert isinstance(problem, Problem)
    assert "PMMA, thickness 6 mm" in problem._repr_html_()
    assert "index 1.5, thickness" in problem.with_(**{"lens.index": 1.5})._repr_html_()
