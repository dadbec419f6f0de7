"""Several sources, a plate of lenses, intensities that a standard asks for: what light is made, in what time.

Two points and four LEDs under one lens; the upper beams of FMVSS 108 and UN R149 from a sharp beam, from half
its light, from one that diverges, and from an LED; a street light of 2 x 6 lenses beside a road's class.
Seconds are those of the whole command `thbcad design`, with its checks.  A margin is that of fresh light, the
least over all rows of the table, as a share of the limit.

Run: thbcad bench luminaires
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import DesignRun, rel_l2_row, run_design
from benchmarks.rows.row import Row
from optics.scene.problem import load_problem

# name, example, changes, least margin that is wanted, and seconds
ZONES = (
    ("UB2, parallel beam of 1058 lm", "headlamp", {}, 0.2, 10.0),
    ("UB2, half the flux", "headlamp", {"source.flux": 529.0}, 0.2, None),
    ("UB2, divergence of 1 degree", "headlamp", {"source.divergence": 1.0}, 0.27, None),
    ("UB2, LED of 2 mm, 1885 lm", "headlamp_led", {}, None, None),
    (
        "R149 class B driving, the same LED",
        "headlamp_led",
        {"target.regulation": "UN R149 class B driving"},
        None,
        None,
    ),
)
ERRORS = 3.0  # standard errors of fresh light that every row's margin exceeds
ROAD = ("--class", "P3", "--height", "8", "--spacing", "30", "--lanes", "2", "--tilt", "10")


def rows() -> list[Row]:
    """Return what the light of every scene is, and the seconds of its design."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return [
            *_two_points(folder),
            *_uniform("four LEDs of 2 mm under one lens", _designed("four_leds", {}, folder)),
            *(row for case in ZONES for row in _zones(folder, *case)),
            *_plate(folder),
        ]


def _designed(example: str, changes: dict[str, object], folder: Path) -> DesignRun:
    path = folder / "problem.toml"
    path.write_text(load_problem(EXAMPLES / f"{example}.toml").with_(**changes).to_toml(), "utf-8")
    return run_design(path, folder / "design", must_pass=False)


def _two_points(folder: Path) -> list[Row]:
    run = _designed("two_sources", {}, folder)
    error = rel_l2_row("two points, one free surface, square: rel_l2", run.metrics, limit=0.08)
    return [error, _seconds(run, 15.0)]


def _uniform(title: str, run: DesignRun) -> list[Row]:
    even = run.metrics["uniformity"]
    return [
        Row(f"{title}: U0", even["min_over_mean"], limit=0.7, sense=">=", error=even["noise"]),
        Row("  light on the lit region, of the sources'", run.metrics["lit_efficiency"]),
        _seconds(run),
    ]


def _zones(
    folder: Path,
    title: str,
    example: str,
    changes: dict[str, object],
    margin: float | None,
    most: float | None,
) -> list[Row]:
    run = _designed(example, changes, folder)
    found = run.metrics["zones"]
    clear = sum(row["margin_in_errors"] > ERRORS for row in found)
    return [
        Row(f"{title}: rows kept by 3 standard errors", clear, limit=len(found), sense=">="),
        Row("  least margin", min(row["margin"] for row in found), limit=margin, sense=">="),
        Row("  distance to the smoothest light that keeps them, rel_l2", run.metrics["rel_l2"]),
        _seconds(run, most),
    ]


def _plate(folder: Path) -> list[Row]:
    run = _designed("street_plate", {}, folder)
    command = [sys.executable, "-m", "optics", "road", str(folder / "design"), *ROAD, "--json"]
    road = json.loads(subprocess.run(command, capture_output=True).stdout)
    kept = sum(check["ok"] for check in road["checks"])
    return [
        *_uniform("plate of 2 x 6 lenses for a street light", run),
        Row("  crosstalk, of the light of one source", run.metrics["crosstalk"]),
        Row("  checks of road class P3 that are kept", kept, limit=len(road["checks"]), sense=">="),
    ]


def _seconds(run: DesignRun, limit: float | None = None) -> Row:
    return Row("  whole design", run.seconds, "s", limit=limit)
