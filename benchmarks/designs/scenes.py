"""One free mirror or lens anywhere, before a screen anywhere: how close its light comes, and in what time.

A mirror in a beam at 45 degrees; the same before a point; a lens whose screen is turned towards it and away
from it, where it meets total reflection unless both of its faces bend the light; a column as screen; and a
fixed element before the mirror, or behind the lens; and a lens and a mirror that are both free.
Seconds are those of the whole command `thbcad design`, with its checks.

Run: thbcad bench scenes
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import rel_l2_row, run_design
from benchmarks.rows.row import Row
from optics.scene.problem import load_problem

TOP_HAT = {"target.kind": "tophat", "target.image": "", "target.lit": [0.8, 0.8]}
PEARL = {"target.kind": "image", "target.image": str(EXAMPLES / "pearl.png")}
SQUARE = {"target.half_width": [100.0, 100.0], "target.pixels": [256, 256], "optimizer.iterations": [60]}
# the screen's own y goes on along the beam: then the fine detail lies where the mirror has much room for it
BESIDE = SQUARE | {"target.position": [0, 300, 0], "target.tilt": [-90, 0, 180]}
NEAR = BESIDE | {"element.M1.face.half_width": [53.0, 87.5]}
ASIDE = SQUARE | {"target.distance": None, "target.position": [150, 0, 340]}
# of uneven light, by a mirror near a lamp or on a turned screen: a level more than the usual five pays there
AUTO = {"z_freedom": "auto", "max_level": "auto"}
# of light that is less uneven: instead of a level more, finer spans, of which the usual five levels make 320
SPANS = {"z_freedom": "auto", "spans": [10, 10]}
THICK = {"lens.thickness": 60.0, "lens.rear.freeform.z_freedom": "auto"}


def _tilted(beam: float, front: float, rear: float, position: list[float], tilt: float) -> dict[str, object]:
    """Return a plate in place of the lens, tilted in a beam along z, so that both of its faces bend light.

    beam, front, rear : mm, half-widths in x.  position : of the front vertex.  tilt : degrees about y.
    """
    free = {"half_width": [rear, 50.0], "radius": "auto", "conic": "auto", "freeform": AUTO}
    lens = {
        "kind": "lens",
        "name": "L1",
        "position": position,
        "tilt": [0.0, tilt, 0.0],
        "index": 1.5,
        "thickness": 20.0,
        "front": {"half_width": [front, 50.0]},
        "rear": free,
    }
    return {"lens": None, "element": [lens], "source.half_width": [beam, 47.5], "source.distance": 150.0}


@dataclass(frozen=True)
class Scene:
    """An example with other keys, and the rel_l2 and the seconds that are wanted, if any."""

    example: str
    wanted: float | None
    changes: Mapping[str, object] = field(default_factory=dict)
    seconds: float | None = None


SCENES = {
    "mirror, beam at 45 degrees, pearl": Scene("mirror", 0.028, BESIDE | {"optimizer.iterations": [52]}, 12),
    "mirror, beam at 45 degrees, top hat": Scene("mirror", 0.005, BESIDE | TOP_HAT),
    "mirror, point, pearl": Scene(
        "lamp_reflector", 0.035, NEAR | PEARL | {"element.M1.face.freeform.max_level": "auto"}
    ),
    "mirror, point, top hat": Scene(
        "lamp_reflector",
        0.006,
        NEAR | {"target.lit": [0.8, 0.8], "element.M1.face.freeform.max_level": "auto"},
    ),
    # the light in the glass is turned by 13 degrees, towards the screen
    "lens, screen turned to it, both faces bend": Scene(
        "pearl",
        0.029,
        ASIDE
        | {"target.position": [-9.793, 0, 332.09], "target.tilt": [0, 18.403, 0]}
        | _tilted(41.197, 64.1, 54.6, [7.0553, 0, 5.4327], -37.597),
    ),
    # the light in the glass goes on along the axis of the beam: the plate's rear does what a wedge's would
    "lens, screen turned from it": Scene(
        "pearl",
        0.035,
        ASIDE
        | {"target.position": [-1.7194, 0, 339.75], "target.tilt": [0, -71.489, 0]}
        | _tilted(26.893, 70.7, 62.0, [6.7196, 0, 13.1252], -62.889),
    ),
    **{
        f"lens, column of radius {r:g} mm": Scene("curved_screen", 0.029, {"target.radius": r})
        for r in (500.0, -500.0, 120.0)
    },
}
ROWS = {
    "fixed lens that spreads the beam, mirror": Scene(
        "two_elements", 0.032, {"element.M1.face.freeform": SPANS, "optimizer.iterations": [24]}, 15
    ),
    "lens, fixed hollow mirror of radius 800 mm": Scene(
        "folded",
        0.030,
        {
            "element.L1.thickness": 20.0,
            "element.L1.rear.freeform": {"z_freedom": "auto"},
            "element.M1.position": [0, 0, 170],
            "element.M1.face.radius": -800.0,
            "element.M1.face.half_width": [110.0, 205.0],
            "target.position": [0, 300, 170],
            "optimizer.iterations": [40],
        },
        15,
    ),
}
# of a lens and a mirror, one or both free; the one that is fixed has the base that the program chose for it
LONG = {"optimizer.iterations": [100]}
OF_LENS = {"element.L1.rear.conic": -1.0, "element.L1.rear.freeform": {"z_freedom": 2.0}}
TOGETHER = {
    "two elements, mirror free": LONG,
    "two elements, lens free": LONG
    | OF_LENS
    | {
        "element.L1.rear.radius": "auto",
        "element.L1.rear.freeform": {"z_freedom": "auto"},
        "element.M1.face.radius": -880.0,
        "element.M1.face.freeform": False,
    },
    "two elements, both free": LONG | OF_LENS,
}
TOTAL = Scene("pearl", 0.0, ASIDE | THICK | {"target.tilt": [0, 45, 0]})


def rows() -> list[Row]:
    """Return error and time of every scene, and what `check` says of the one that cannot be."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        designed = [
            row for title, scene in (SCENES | ROWS).items() for row in _designed(title, scene, folder)
        ]
        return [*designed, *_together(folder), *_refused(folder)]


def _problem(scene: Scene, folder: Path) -> Path:
    """Write the problem file of a scene."""
    path = folder / "problem.toml"
    path.write_text(
        load_problem(EXAMPLES / f"{scene.example}.toml").with_(**scene.changes).to_toml(), "utf-8"
    )
    return path


def _designed(title: str, scene: Scene, folder: Path) -> list[Row]:
    run = run_design(_problem(scene, folder), folder / "design", must_pass=False)
    return [
        rel_l2_row(f"{title}: rel_l2", run.metrics, limit=scene.wanted),
        Row("  whole design", run.seconds, "s", limit=scene.seconds),
    ]


def _together(folder: Path) -> list[Row]:
    """Return error and time of one free element, of the other, and of both, and what both bring."""
    found = [
        _designed(title, Scene("two_elements", None, changes), folder) for title, changes in TOGETHER.items()
    ]
    mirror, lens, both = (rows[0].value for rows in found)
    gain = Row("  rel_l2 over that of the better one alone", both / min(mirror, lens), limit=1.0)
    return [*(row for rows in found for row in rows), gain]


def _refused(folder: Path) -> list[Row]:
    """Return what `check` foresees of a lens that alone would have to bend by more than glass can."""
    command = [sys.executable, "-m", "optics", "check", str(_problem(TOTAL, folder)), "--json"]
    done = subprocess.run(command, capture_output=True, check=True)
    found = json.loads(done.stdout)["expected"]
    return [Row("lens, screen turned to it, one face bends: reflected at the rear", found["reflected"])]
