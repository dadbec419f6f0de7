"""Rows of zones in verdicts: a plate whose light is known, what the noise of rays decides, and words."""

import json
import re
from math import cos, inf, pi, radians

import numpy as np
import pytest

from optics.base.runtime import check_lines, verification
from optics.light.analysis import delivered, delivery_checks, judged, measure
from optics.light.analysis.light_estimate import Light, LightEstimate
from optics.scene.problem import Verify, load_problem
from optics.scene.system import System, advice
from tests.optics.cases import write_problem

LUMENS = 500.0
CONE = {  # an isotropic point before a plate: the same intensity within 20 degrees, less Fresnel's losses
    "lens.rear.radius": inf,
    "source.kind": "point",
    "source.distance": 10.0,
    "source.half_angle": 20.0,
    "source.unit": "lm",
    "source.flux": LUMENS,
    "target.kind": "zones",
    "target.distance": inf,
    "target.half_width": [25.0, 25.0],
    "target.pixels": [50, 50],
    "target.aperture": 1.0,
}
INTENSITY = LUMENS / (2 * pi * (1 - cos(radians(20)))) * 0.96**2  # cd, at normal incidence


def measured(folder, backend, zones, **changes):
    problem = load_problem(write_problem(folder, CONE), {"target.zone": zones, **changes})
    system = System(problem)
    return system, measure(system, backend)


@pytest.mark.slow
def test_the_rows_of_a_known_light_are_judged_one_by_one(tmp_path, backend):
    """Cells tell the light to 1e-3; within 9 degrees Fresnel's losses change by less."""
    zones = [
        {
            "name": "in",
            "points": [[0, 0], [-8, 4]],
            "least": 0.9 * INTENSITY,
            "greatest": 1.3 * INTENSITY,
        },
        {"name": "within", "box": [[-9, -9], [9, 9]], "greatest": 1.02 * INTENSITY},
        {"name": "beyond", "line": [[22, -5], [22, 5]], "least": 10.0},
        {"name": "peak", "peak": True, "least": 2 * INTENSITY},
    ]
    system, found = measured(tmp_path, backend, zones)
    rows = {row["name"]: row for row in found.metrics["zones"]}
    assert [*rows] == [
        "in at (0, 0)",
        "in at (-8, 4)",
        "within, brightest",
        "beyond, darkest",
        "peak",
    ]
    values = [row["value"] / INTENSITY for row in rows.values()]
    assert values == pytest.approx([1, 1, 1, 0, 1], abs=3e-3)
    assert rows["in at (-8, 4)"]["margin"] == pytest.approx(1 / 0.9 - 1, abs=3e-3)
    checks = delivery_checks(found.metrics, system.problem.verify)[:5]
    assert [check.result for check in checks] == ["passed", "passed", "passed", "failed", "failed"]
    verdict = found.verdict(system.problem.verify)
    assert (verdict.grade, verdict.checks[:5]) == ("light misses", tuple(checks))
    assert verdict.sentence.startswith("3 of 5 rows kept, least margin -100%: the light misses")
    lines = check_lines(verification(checks))
    assert re.search(r"ok     in at \(0, 0\): \d{4} cd \(at least \d+\.?\d*\); margin \+11%", lines[0])
    assert json.loads(json.dumps(found.metrics["zones"])) == found.metrics["zones"]
    flux = found.irradiance * system.target.screen().projection()
    light = delivered(system, LightEstimate.exact(Light.of([flux], 1.0, 0.0)), 0.0)
    stored, fresh = ([row["value"] for row in rows["zones"]] for rows in (light, found.metrics))
    assert stored == pytest.approx(fresh, rel=3e-3, abs=1e-6)  # of even light, by wider pixels


@pytest.mark.slow
def test_zones_are_read_over_an_aperture_however_wide_pixels_are(tmp_path, backend):
    """A cone ends at 5 degrees, in the middle between the centres of two pixels, whose means hide it."""
    zone = {"points": [[4.7, 0], [5.3, 0]], "least": 1.0}
    narrow = {"source.half_angle": 5.0, "target.half_width": [6.0, 6.0], "target.pixels": [12, 12]}
    system, found = measured(tmp_path, backend, [zone], **narrow, **{"target.aperture": 0.0})
    _, wide = measured(tmp_path, backend, [zone], **narrow)
    ahead = LUMENS / (2 * pi * (1 - cos(radians(5)))) * 0.96**2
    values, hidden = ([row["value"] / ahead for row in run.metrics["zones"]] for run in (found, wide))
    assert values == pytest.approx([1.0, 0.0], abs=0.01)
    assert hidden == pytest.approx([0.8, 0.2], abs=0.1)
    notes = [note for note in advice(system) if "zones are read over 0.15 degrees" in note]
    assert [note.partition("--set ")[2] for note in notes] == ["target.pixels=[80, 80]"]
    fine = load_problem(
        tmp_path / "problem.toml", narrow | {"target.pixels": [80, 80], "target.zone": [zone]}
    )
    assert not any("zones are read" in note for note in advice(System(fine)))


ROW = {"name": "at (0, 0)", "value": 100.0, "error": 5.0, "least": 92.0, "greatest": None, "limit": 92.0}
ROW |= {"at_least": True, "margin": 8 / 92, "margin_in_errors": 1.6, "unit": "cd"}
METRICS = {"rel_l2_debiased": 0.3, "rel_l2_error": 0.0, "lit_efficiency": 0.9, "rays": 1000}


def test_a_row_within_two_standard_errors_of_its_limit_is_not_decided():
    """1.6 errors: (2 / 1.6)^2 times the rays would tell."""
    found = METRICS | {"zones": [ROW]}
    checks = delivery_checks(found, Verify())
    assert (checks[0].result, checks[0].remark) == (
        "undecided",
        "margin +9%, +1.6 standard errors; about 1.6e+03 rays in place of 1.0e+03 would decide: "
        "more target.pixels are measured by more rays",
    )
    assert judged(found, checks).grade == "not decided"
    decided = METRICS | {"zones": [ROW | {"error": 3.0, "margin_in_errors": 8 / 3}]}
    assert judged(decided, delivery_checks(decided, Verify())).grade == "made"


def test_an_extended_source_gives_rows_the_errors_of_its_rays(tmp_path, backend):
    """Two seeds differ by some of their errors."""
    zone = {"points": [[0, 0], [3, 3], [-6, 2]], "least": 1.0}
    led = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.half_angle": 20.0}
    runs = [measured(tmp_path, backend, [zone], **led, **{"run.seed": s})[1] for s in (0, 1)]
    one, other = ([(r["value"], r["error"]) for r in run.metrics["zones"]] for run in runs)
    off = [(a - b) / np.hypot(s, t) for (a, s), (b, t) in zip(one, other)]
    assert np.abs(off).max() < 4
    assert all(0 < s < 0.05 * a for a, s in one)
