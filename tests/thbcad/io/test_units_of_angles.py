"""STEP files whose unit of plane angles is the degree: cones, and images of edges on round faces, mean the
same solid."""

import math
import re

import numpy as np
import pytest

from tests.thbcad.io.cases import SOLIDS, written
from thbcad.cad.exchange import SolidState, step_shape
from thbcad.io.brep_measure import volume
from thbcad.io.parameter_curves import image_distance
from thbcad.io.step_brep import brep_of_text

RADIAN = r"\(\s*NAMED_UNIT\(\*\)\s*PLANE_ANGLE_UNIT\(\)\s*SI_UNIT\(\$,\.RADIAN\.\)\s*\)"
DEGREE = "(CONVERSION_BASED_UNIT('DEGREE',#900001)NAMED_UNIT(#900002)PLANE_ANGLE_UNIT())"
UNIT = """#900001=PLANE_ANGLE_MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE(0.017453292519943295),#900003);
#900002=DIMENSIONAL_EXPONENTS(0.,0.,0.,0.,0.,0.,0.);
#900003=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));
"""


def entity(text, number):
    """What stands behind #number =."""
    return re.search(rf"#{number}\s*=\s*([^;]*);", text)[1]


def replaced(text, number, values):
    """The text with other reals in the last list or in the last place of an entity."""
    before = entity(text, number)
    after = re.sub(r"\([^()]*\)\s*\)\s*$", "(" + ",".join(f"{v!r}" for v in values) + "))", before)
    return text.replace(f"#{number} = {before};", f"#{number} = {after};")


def reals(text):
    return [float(word) for word in re.search(r"\(([-+.\dE,\s]*)\)\s*\)\s*$", text)[1].split(",")]


def in_degrees(text):
    """A file of OCCT by hand: another unit, cones and lines in the parameters of round faces."""
    text = re.sub(r"\s*\n\s*", "", text).replace(";", ";\n")
    turn = math.degrees(1)
    factors = {"CYLINDRICAL": (turn, 1), "CONICAL": (turn, 1), "SPHERICAL": (turn, turn)}
    for surface, items in re.findall(r"PCURVE\('',#(\d+),#(\d+)\)", text):
        factor = next((f for kind, f in factors.items() if entity(text, surface).startswith(kind)), None)
        drawn = entity(text, re.search(r"\(#(\d+)\)", entity(text, items))[1])
        if factor is None:
            continue
        point, vector = re.fullmatch(r"LINE\('',#(\d+),#(\d+)\)", drawn).groups()
        direction, length = re.fullmatch(r"VECTOR\('',#(\d+),(.*)\)", entity(text, vector)).groups()
        step = np.array(reals(entity(text, direction))) * float(length) * factor
        size = float(np.linalg.norm(step))
        text = replaced(text, point, (np.array(reals(entity(text, point))) * factor).tolist())
        text = replaced(text, direction, (step / size).tolist())
        text = text.replace(
            f"#{vector} = {entity(text, vector)};", f"#{vector} = VECTOR('',#{direction},{size!r});"
        )
    text = re.sub(
        r"(CONICAL_SURFACE\('',#\d+,[^,]*,)([^)]*)\)", lambda m: f"{m[1]}{turn * float(m[2])!r})", text
    )
    assert re.search(RADIAN, text)
    return re.sub(RADIAN, DEGREE, text).replace("DATA;\n", "DATA;\n" + UNIT)


def test_a_solid_in_degrees_is_that_in_radians(tmp_path):
    """Against the file in radians, and against OCCT, which converts."""
    path = written(SOLIDS["cone with a bore"](), tmp_path / "solid.step")
    radians = brep_of_text(path.read_text())
    path.write_text(in_degrees(path.read_text()))
    degrees = brep_of_text(path.read_text())
    assert volume(degrees) == pytest.approx(volume(radians), rel=1e-13)
    assert image_distance(degrees)[0] == pytest.approx(image_distance(radians)[0], abs=1e-13)
    assert SolidState(step_shape(path)).volume == pytest.approx(volume(radians), rel=1e-6)
    cones = [[f.cone[3, 1] for f in solid.faces if f.cone is not None] for solid in (radians, degrees)]
    assert cones[1] == pytest.approx(cones[0], rel=1e-15)


@pytest.mark.parametrize(
    "unit",
    [
        "(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT(.MILLI.,.RADIAN.))",
        "(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.STERADIAN.))",
        "(CONVERSION_BASED_UNIT('DEGREE',#900004)NAMED_UNIT(#900002)PLANE_ANGLE_UNIT())",
        "(CONVERSION_BASED_UNIT('DEGREE',#900002)NAMED_UNIT(#900002)PLANE_ANGLE_UNIT())",
    ],
)
def test_a_unit_of_angles_that_is_not_told_is_refused(unit, tmp_path):
    path = written(SOLIDS["cone with a bore"](), tmp_path / "solid.step")
    zero = "#900004=PLANE_ANGLE_MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE(0.),#900003);\n"
    text = in_degrees(path.read_text()).replace(DEGREE, unit).replace("DATA;\n", "DATA;\n" + zero)
    with pytest.raises(ValueError, match=r"unit of plane angles #\d+ must be radians or a number of them"):
        brep_of_text(text)
