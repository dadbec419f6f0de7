"""`thbcad etendue`: figures, sentences, errors."""

from __future__ import annotations

import json
from argparse import Namespace

import numpy as np
import pytest

from optics.commands.etendue_command import NO_LIMIT, etendue
from optics.etendue import QUICK, certain_bound, etendue_note, limit_sentence
from optics.problem import load_problem
from optics.runtime import UserError
from optics.system import OpticalSystem
from tests.cases import ROOT
from tests.optics.cases import HOLLOW, hollow_lens
from thbcad.io import write_lens

GLOWING = HOLLOW | {
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "target.kind": "tophat",
    "target.shape": "ellipse",
    "target.half_width": [600.0, 600.0],
}


def run(file, efficiency=None, measure=None, out=None):
    options = {"efficiency": efficiency, "measure": measure, "out": out, "force": False}
    options |= {"set": [], "verbose": False}
    return etendue(Namespace(problem=str(file), **options))


@pytest.fixture
def hollow(problem_file):
    """A function that writes the problem of a glowing square in the hollow of a lens, with changes."""
    return lambda changes=None: problem_file(GLOWING | (changes or {}))


def test_figures_of_an_extended_source(hollow, tmp_path):
    data, lines, ok = run(hollow(), out=str(tmp_path / "bound.png"))
    assert ok
    assert data["etendue_mm2_sr"]["source"] == pytest.approx(np.pi)
    assert data["etendue_mm2_sr"]["front"] == pytest.approx(np.pi)  # the rim lies behind the source
    assert data["flux_w"]["arriving"] == pytest.approx(0.96**2)
    assert data["efficiency"] == data["flux_w"]["picture"] == data["flux_w"]["arriving"]
    bound = data["bound"]
    assert 0 < bound["lower_bound"] <= bound["attained"] < 1.05 * bound["lower_bound"]
    assert bound["kkt"] <= 1e-5
    assert any(f"rel_l2 is at least {bound['lower_bound']:.4f}" in line for line in lines)
    assert any("through every point of a rear as large" in line for line in lines)
    assert (tmp_path / "bound.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_less_light_allows_smaller_images(hollow):
    most, less = (run(hollow(), share)[0]["bound"] for share in (None, 0.4))
    # and a little larger, since they come nearer to the target
    np.testing.assert_allclose(less["pixels"], np.multiply(most["pixels"], np.sqrt(0.4 / 0.96**2)), rtol=0.02)
    assert less["lower_bound"] < most["lower_bound"]


@pytest.mark.slow
def test_images_of_a_designed_lens(hollow, tmp_path):
    write_lens(hollow_lens(), tmp_path / "lens.json")
    data, lines, _ = run(hollow({"target.pixels": [24, 24]}), measure=str(tmp_path))
    assert all(
        measured > least for measured, least in zip(data["measured"]["pixels"], data["bound"]["pixels"])
    )
    assert sum("images of the source: at least" in line for line in lines) == 2


def test_a_picture_under_another_suffix_is_refused(hollow, tmp_path):
    with pytest.raises(UserError, match=r"--out must end in \.png, .* got .*bound\.gif"):
        run(hollow(), out=str(tmp_path / "bound.gif"))
    assert not (tmp_path / "bound.gif").exists()


@pytest.mark.parametrize(
    "changes", [{}, {"source.kind": "point", "source.distance": 20.0, "source.half_width": [0.0, 0.0]}]
)
def test_sources_without_extent_have_no_limit(problem_file, changes):
    file = problem_file(changes)
    data, lines, ok = run(file)
    assert (ok, lines[-1], "bound" in data) == (True, NO_LIMIT, False)
    problem = load_problem(file)
    assert etendue_note(OpticalSystem(problem)) == []
    assert (
        limit_sentence(
            OpticalSystem(problem), OpticalSystem(problem).lens, {"rel_l2": 0.1, "efficiency": 0.9}
        )
        is None
    )


def test_images_narrower_than_two_pixels_set_no_limit(hollow):
    data, lines, _ = run(hollow({"source.half_width": [0.05, 0.05]}))
    assert data["bound"]["lower_bound"] == 0
    assert any("narrower than two pixels" in line for line in lines)


def test_other_sources_and_the_far_field(hollow):
    far = {"target.distance": float("inf"), "target.half_width": [35.0, 35.0], "target.pixels": [32, 32]}
    data, lines, _ = run(hollow(far | {"source.profile": "round"}))
    assert 0 < data["bound"]["lower_bound"] <= data["bound"]["attained"]
    assert any("degrees" in line for line in lines)
    assert any("no uniform rectangle" in line for line in lines)


@pytest.mark.slow
def test_the_notes_are_quick_bounds(hollow):
    """They are below the careful bound, since merged pixels and a coarser solution cost sharpness only."""
    problem = load_problem(hollow({"target.pixels": [96, 96]}))
    [sentence] = etendue_note(OpticalSystem(problem))
    careful = certain_bound(OpticalSystem(problem), OpticalSystem(problem).lens, 0.96**2).bound.lower_bound
    assert 0 < float(sentence.split()[-1]) <= careful + 5e-4  # of rounding in the sentence
    reached = limit_sentence(OpticalSystem(problem), hollow_lens(), {"rel_l2": 0.25, "efficiency": 0.96**2})
    assert reached.startswith("rel_l2 reached 0.2500")
    assert 0 < float(reached.split()[-1]) <= careful + 5e-5
    assert limit_sentence(OpticalSystem(problem), hollow_lens(), {"rel_l2": 1.0, "efficiency": 0.0}) is None


def test_a_target_brighter_than_the_source_is_told(hollow):
    problem = load_problem(hollow({"target.half_width": [2.0, 2.0], "target.pixels": [16, 16]}))
    sentences = etendue_note(OpticalSystem(problem))
    assert len(sentences) == 2
    assert "times the radiance of the source" in sentences[0]


@pytest.mark.parametrize("efficiency", [0.0, -1.0, 1.5, float("nan")])
def test_an_efficiency_out_of_range_is_refused(hollow, efficiency):
    with pytest.raises(UserError, match="--efficiency must be greater than 0 and at most 1"):
        run(hollow(), efficiency)


@pytest.mark.parametrize("name", [pytest.param("extended", marks=pytest.mark.slow), "extended_two"])
def test_the_bound_lies_below_the_designs_at_hand(name):
    problem = load_problem(ROOT / "examples" / f"{name}.toml")
    metrics = json.loads((ROOT / "exports" / "curated" / name / "metrics.json").read_text("utf-8"))
    share = metrics["efficiency"]
    bound = certain_bound(OpticalSystem(problem), OpticalSystem(problem).lens, share, QUICK).bound
    assert 0.02 < bound.lower_bound < metrics["rel_l2"]
