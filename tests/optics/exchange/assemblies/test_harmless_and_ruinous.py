"""Twenty parts, ten that leave the light alone and ten that do not: each is judged right by its STEP file.

BEAM is a parallel beam of |x|, |y| <= 47.5 mm through a lens of 50 mm with a plane front at z = 0 and the
rear z = 20 + r^2 / 400, behind which light at x has the slope x / 400.  POINT lights the cone of 30 degrees
from z = -60: r <= 34.6 mm of a plane front of 40 mm, and by Snell's law r <= 42.5 mm of the rear
z = 35 - r^2 / 140 of 45 mm.
"""

import build123d as bd
import pytest

from optics.base.runtime import UserError
from optics.exchange.assemblies import part_checks
from optics.exchange.assemblies.light_checks import ELSEWHERE
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.cases import ROOT
from tests.optics.cases import failing
from thbcad import write_step
from thbcad.cad import LensPart, cut, join

BEAM = System(
    load_problem(
        ROOT / "examples/tophat_square.toml",
        {"lens.rear.radius": 200.0, "target.lit": (0.9, 0.9), "target.pixels": (40, 40)},
    )
)
POINT = System(
    load_problem(
        ROOT / "examples/point.toml",
        {
            "target.kind": "tophat",
            "target.image": "",
            "target.lit": (1.0, 1.0),
            "target.half_width": (400.0, 400.0),
        },
    )
)


def box(x, y, z):
    """A box between pairs of limits."""
    middle, size = zip(*(((a + b) / 2, b - a) for a, b in (x, y, z)))
    return bd.Pos(*middle) * bd.Box(*size)


def rod(radius, at, along, length=400):
    turn = {"x": (0, 90, 0), "y": (90, 0, 0), "z": (0, 0, 0)}.get(along, along)
    return bd.Pos(*at) * bd.Rot(*turn) * bd.Cylinder(radius, length)


def outside(shape):
    return box((-200, 200), (-200, 200), (-200, 200)) - shape


def octagon(reach):
    """All with |x| + |y| <= reach."""
    return bd.Rot(0, 0, 45) * bd.Box(reach * 2**0.5, reach * 2**0.5, 300)


FLANGE = box((-60, 60), (-60, 60), (2, 5))
BEHIND = [box((-2, 2), (55, 58), (4, 41)), box((-2, 2), (-58, 58), (40, 42))]
BEFORE = [box((12, 12.5), (55, 58), (-4.5, 3)), box((12, 12.5), (-58, 58), (-5, -4))]
BESIDE = [box((49, 51), (55, 58), (-5, 3)), box((49, 51), (-58, 58), (-6, -4))]

HARMLESS = {
    "screw holes in a flange": (
        BEAM,
        [FLANGE],
        [rod(2, (x, y, 0), "z") for x in (-55, 55) for y in (-55, 55)],
    ),
    "a round lens round its cone": (POINT, [], [outside(bd.Cylinder(44, 300))]),
    "corners cut off beside a square beam": (BEAM, [], [outside(octagon(96))]),
    "a notch in the rim": (BEAM, [], [box((48, 60), (-5, 5), (-50, 50))]),
    "a fine blind hole in the rim": (BEAM, [], [rod(0.02, (58, 10, 10), "x", 20)]),
    "a bar before the front, beside the light": (BEAM, [FLANGE, *BESIDE], []),
    "a wall behind the rear, beside the light": (BEAM, [FLANGE, box((53, 56), (-40, 40), (4, 60))], []),
    "a hole along the rim": (BEAM, [], [rod(0.9, (49, 0, 10), "y")]),
    "pins on a flange": (BEAM, [FLANGE], [box((54, 56), (-1, 1), (-20, 20))]),
    "a fine saw cut in the rim": (BEAM, [], [box((9.98, 10.02), (48, 60), (-50, 50))]),
}
RUINOUS = {
    "a fine side hole": (BEAM, [], [rod(0.02, (0, -17, 8), "x")]),
    "a slanted side hole": (BEAM, [], [rod(1.3, (0, -20, 10), (0, 88, 20))]),
    "a fine bore through both faces": (BEAM, [], [rod(0.02, (10, 5, 0), "z")]),
    "a blind bore in the front": (BEAM, [], [rod(5, (-7, 8, 1), "z", 4)]),
    "corners cut off a square beam": (BEAM, [], [outside(octagon(85))]),
    "an arm behind the rear": (BEAM, [FLANGE, *BEHIND], []),
    "a thin bar before the front": (BEAM, [FLANGE, *BEFORE], []),
    "a deep notch": (BEAM, [], [box((44, 60), (-10, 10), (-50, 50))]),
    "a bubble": (BEAM, [], [bd.Pos(-21, 13, 12) * bd.Sphere(0.3)]),
    "a round lens within its cone": (POINT, [], [outside(bd.Cylinder(38, 300))]),
}
QUICK = ("a notch in the rim", "a fine blind hole in the rim", "a fine side hole", "an arm behind the rear")
COARSE = 1 << 17  # rays, an eighth of all: what is not fine stops hundreds of them
CASES = [
    pytest.param(
        *case,
        harmless,
        None if "fine" in name else COARSE,
        id=name,
        marks=[] if name in QUICK else [pytest.mark.slow],
    )
    for cases, harmless in ((HARMLESS, True), (RUINOUS, False))
    for name, case in cases.items()
]


@pytest.mark.slow
@pytest.mark.parametrize(("system", "added", "removed", "harmless", "rays"), CASES)
def test_a_part_is_judged_by_its_light(system, added, removed, harmless, rays, tmp_path, monkeypatch):
    if rays:
        monkeypatch.setattr("optics.exchange.assemblies.light_samples.RAYS", rays)
    part = LensPart(system.base)
    for tool in added:
        part = join(part, tool, "mount")
    for tool in removed:
        part = cut(part, tool, "cut")
    write_step(part, tmp_path / "part.step", lens=system.base)
    if any(isinstance(tool, bd.Sphere) for tool in removed):
        with pytest.raises(UserError, match="BREP_WITH_VOIDS"):
            part_checks(tmp_path / "part.step", system.base, False, system)
        return
    checks, _ = part_checks(tmp_path / "part.step", system.base, False, system)
    failed = failing(checks)
    assert (failed == []) == harmless, failed
    # what fails is the light or the glass, not the file
    words = ("holes and pads", "faces of the part within", "share of the light", "rays of")
    assert all(name.startswith(words) for name in failed)


@pytest.mark.slow
def test_light_before_other_elements_is_left_out_and_not_called_free(tmp_path):
    """A mirror behind the lens turns the light: a hull straight to the screen would not hold it."""
    numbers = {"radius": 200.0, "conic": -1.0, "freeform.z_freedom": 1.0}
    changes = {f"element.L1.rear.{key}": value for key, value in numbers.items()}
    system = System(load_problem(ROOT / "examples/folded.toml", changes))
    part = LensPart(system.base)
    for tool in (FLANGE, *BEHIND):
        part = join(part, tool, "mount")
    write_step(part, tmp_path / "part.step", lens=system.base)
    checks, left_out = part_checks(tmp_path / "part.step", system.base, False, system)
    assert ELSEWHERE in left_out
    assert not any("target" in check.name for check in checks)
