"""Each claim can fail; its limits are those of the stored benchmarks and of the page."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

from benchmarks.rows.stored_rows import read_rows
from optics.interface.audit import CLAIMS, judged
from optics.interface.audit.experiments import Ended
from tests.cases import ROOT

OF = {claim.key: claim for claim in CLAIMS}
STORED = {
    f"{name}: {full}": row
    for name, rows in read_rows(ROOT / "docs" / "data").items()
    for full, row in rows.named()
}
# claim: the stored row that supports it; its limit is that of the row, or at most TWICE the value of the row
SUPPORT = {
    "first": "audit: first design, empty kernel cache",
    "later": "audit: later designs",
    "light": "overview: tophat_square: rel_l2",
    "surface": "overview: tophat_square: STEP faces against the optimised surface",
    "landing": "external: optiland: 1e+05 rays > landing points, root mean square, the same rays",
    "occt": "external: occt: 1e+05 rays > z-score",
    "meshes": "refinement: crescent: share of the 51529 degrees of freedom of uniform level 5 at equal error",
}
TWICE = 2.0
LANDS = "landing points by optiland's trace of the file"


def ended(data, code=0, err="", cpu=0.0, loop=1.0):
    return Ended(("design",), code, json.dumps(data), err, cpu=cpu, wall=cpu, loop=loop)


def check(name, value=0.0, result="passed", subject="file"):
    return {"name": name, "value": value, "result": result, "subject": subject}


@pytest.fixture
def stand_in(tmp_path):
    """Experiments whose answers a test gives: of designs by folder, of commands by their first two words."""
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels" / "kernel.bin").touch()
    for name in ("first", "second", "third"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "lens.step").write_bytes(b"same")
    made = SimpleNamespace(folder=tmp_path, kernels=tmp_path / "kernels", designs={}, commands={})
    made.design = lambda name: made.designs.get(name, ended({"metrics": {"rel_l2": 8e-4}}))
    made.command = lambda *words: made.commands[words[:2]]
    return made


def found(key, experiments, **changes):
    (row,) = judged(experiments, (replace(OF[key], **changes),))
    return row.found


def test_there_are_twelve_claims():
    assert len(CLAIMS) == len(OF) == 12


@pytest.mark.parametrize("key", SUPPORT)
def test_the_limit_of_a_claim_is_that_of_a_stored_row(key):
    row, limit = STORED[SUPPORT[key]], OF[key].limit
    allowed = float(row["limit"].removeprefix("<= ")) if row["limit"] else None
    assert row["value"] <= limit
    assert limit == allowed or limit <= TWICE * row["value"]


def test_the_page_has_each_claim_as_it_is_printed():
    page = (ROOT / "docs" / "audit.md").read_text("utf-8")
    rows = re.findall(r"^\| (\d+) \| (.*?) \|", page, re.MULTILINE)
    assert [(int(number), text) for number, text in rows] == [
        (number, claim.claimed) for number, claim in enumerate(CLAIMS, 1)
    ]


@pytest.mark.parametrize(("cpu", "holds"), [(1.9, True), (2.1, False)])
@pytest.mark.parametrize("key", ["first", "later"])
def test_a_time_may_be_twice_as_long_as_claimed(key, cpu, holds, stand_in):
    for name in ("first", "second", "third"):
        stand_in.designs[name] = ended({}, cpu=cpu)
    assert found(key, stand_in, limit=1.0).holds is holds


def test_the_later_time_is_the_faster_of_two(stand_in):
    stand_in.designs = {
        "first": ended({}, cpu=9.0),
        "second": ended({}, cpu=3.0),
        "third": ended({}, cpu=2.0),
    }
    assert found("later", stand_in).value == 2.0


def test_without_kernels_in_their_folder_no_run_is_a_first_one(stand_in):
    (stand_in.kernels / "kernel.bin").unlink()
    assert (found("first", stand_in).holds, found("first", stand_in).here) == (None, "not tried")


@pytest.mark.parametrize(("error", "holds"), [(9.9e-4, True), (1.1e-3, False)])
def test_the_error_of_the_light_has_a_limit(error, holds, stand_in):
    stand_in.designs["first"] = ended({"metrics": {"rel_l2": error}}, code=1)
    assert found("light", stand_in).holds is holds


def test_a_design_that_fails_is_a_claim_that_does_not_hold(stand_in):
    stand_in.designs["first"] = ended({}, code=3, err="thbcad: the loss is not finite\n")
    seen = found("light", stand_in)
    assert (seen.holds, seen.here) == (False, "not measured")
    assert seen.remark.endswith("ended with exit code 3: thbcad: the loss is not finite")


def test_one_other_byte_is_found(stand_in):
    assert found("bytes", stand_in).holds
    (stand_in.folder / "third" / "lens.step").write_bytes(b"Same")
    seen = found("bytes", stand_in)
    assert (seen.holds, seen.here) == (False, "1 of 2 differ")


@pytest.mark.parametrize(
    ("checks", "holds"),
    [([check(LANDS, 1e-13)], True), ([check(LANDS, 2e-8)], False), ([check("landing points by OCCT")], None)],
)
def test_landing_points_are_those_of_optiland(checks, holds, stand_in):
    stand_in.commands["verify", "first"] = ended({"checks": checks})
    seen = found("landing", stand_in)
    assert seen.holds is holds
    assert ('pip install "thbcad[verify]"' in seen.remark) == (holds is None)


@pytest.mark.parametrize(
    ("z", "result", "holds"), [(-0.3, "passed", True), (5.1, "passed", False), (-0.3, "failed", False)]
)
def test_light_by_occt_may_differ_by_its_noise(z, result, holds, stand_in):
    light = {"same_rays": {"landing_greatest": 1e-12}, "own_rays": {"z": z}}
    stand_in.commands["verify", "first"] = ended({"checks": [check("rays", result=result)], "light": light})
    assert found("occt", stand_in).holds is holds


@pytest.mark.parametrize(
    ("code", "failed", "holds"), [(4, ["rear numbers", "rear face", "area"], True), (0, [], False)]
)
def test_damage_must_be_found(code, failed, holds, stand_in, monkeypatch):
    moved = SimpleNamespace(entity=9, row=1, column=2, before=1.0, after=1.001)
    monkeypatch.setattr("optics.interface.audit.claims.move_control_point", lambda *_: moved)
    stand_in.commands["verify", "first"] = ended({"checks": [check("rear face")]})
    checks = [check(name, result="failed") for name in failed]
    stand_in.commands["verify", "damaged"] = ended({"checks": checks}, code=code)
    seen = found("damage", stand_in)
    assert seen.holds is holds
    assert seen.here == f"exit {code}, {len(failed)} checks fail"
    if holds:
        assert seen.remark.endswith(
            "from 1.000000 to 1.001000 mm. Failing: rear numbers; rear face; and 1 more"
        )


def test_damage_says_nothing_where_the_unharmed_file_fails_too(stand_in):
    stand_in.commands["verify", "first"] = ended({"checks": [check("rear face", result="failed")]}, code=4)
    seen = found("damage", stand_in)
    assert (seen.holds, seen.remark) == (False, "rear face")


@pytest.mark.parametrize(
    ("typo", "far", "remedied", "here"),
    [
        ("did you mean target.distance?", "by --set target.distance=34.2", 0, "2 of 2 work"),
        ("unknown key", "by --set target.distance=34.2", 0, "1 of 2 work"),
        ("did you mean target.distance?", "by --set target.distance=34.2", 2, "0 of 2 work"),
    ],
)
def test_advice_is_followed(typo, far, remedied, here, stand_in):
    answers = {
        "target.distnace=300": ended({}, code=2, err=typo),
        "target.distance=30": ended({}, code=2, err=far),
        "target.distance=300": ended({}, code=remedied),
        "target.distance=34.2": ended({}, code=remedied),
    }
    stand_in.command = lambda *words: answers[words[3]]
    seen = found("advice", stand_in)
    assert (seen.here, seen.holds) == (here, here.startswith("2"))


@pytest.mark.parametrize(
    ("bound", "holds", "here"),
    [(1.0005, True, "hold, 0.05 % apart"), (1.01, False, "hold, 1 % apart"), (0.99, False, "1 broken")],
)
def test_bounds_must_hold_and_be_close(bound, holds, here, stand_in, monkeypatch):
    from optics.interface.audit.dense_samples import BoundGap

    gaps = [BoundGap("slope", bound, 1.0, 1)]
    monkeypatch.setattr("optics.interface.audit.claims.read_lens", lambda _: None)
    monkeypatch.setattr("optics.interface.audit.claims.bound_gaps", lambda _: gaps)
    seen = found("bounds", stand_in)
    assert (seen.holds, seen.here) == (holds, here)


@pytest.mark.parametrize(
    ("error", "slopes", "holds"), [(2e-3, 1e-10, True), (4e-3, 1e-10, False), (2e-3, 1e-6, False)]
)
def test_a_custom_loss_needs_its_error_and_its_gradient(error, slopes, holds, stand_in, monkeypatch):
    monkeypatch.setattr("optics.interface.audit.claims.loss_results", lambda _: (error, slopes))
    assert found("loss", stand_in).holds is holds


@pytest.mark.parametrize(
    ("refined", "error", "holds"), [(90, 0.021, True), (120, 0.019, False), (90, 0.022, False)]
)
def test_fewer_functions_count_at_equal_error_alone(refined, error, holds, stand_in, monkeypatch):
    from optics.interface.audit.local_refinement import MeshComparison

    meshes = MeshComparison(refined, 1000, error, 0.02)
    monkeypatch.setattr("optics.interface.audit.claims.compare_meshes", lambda _: meshes)
    assert found("meshes", stand_in).holds is holds
