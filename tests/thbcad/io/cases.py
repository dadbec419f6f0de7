"""Shapes with round faces, and shapes written as STEP by OpenCASCADE itself."""

import re

from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert, BRepBuilderAPI_Transform
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

from thbcad.cad.exchange import occt_settings, step_bytes
from thbcad.io import brep_of_text

MILLIMETRE = re.compile(r"#(\d+) = \( LENGTH_UNIT\(\) NAMED_UNIT\(\*\) SI_UNIT\(\.MILLI\.,\.METRE\.\) \);")
INCH = """#{0} = ( CONVERSION_BASED_UNIT('INCH',#{0}1) LENGTH_UNIT() NAMED_UNIT(#{0}3) );
#{0}1 = LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#{0}2);
#{0}2 = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) );
#{0}3 = DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);"""
METRIC = "#{{0}} = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT({},.METRE.) );"
UNITS = {
    "INCH": INCH,
    **{name: METRIC.format(by) for name, by in (("M", "$"), ("CM", ".CENTI."), ("UM", ".MICRO."))},
}


def written(shape, path, unit="MM", schema="AP214IS"):
    """Write a shape by OCCT's plain writer, without names, and return the path.

    unit : of its lengths.  OCCT 7.8 and 8.0 convert them differently: here the numbers stay, and the unit is
    set in the text.
    """
    STEPControl_Writer()  # OCCT's settings exist only once a writer has been made
    with occt_settings({"write.step.unit": "MM", "write.step.schema": schema}):
        writer = STEPControl_Writer()
        writer.Transfer(shape, STEPControl_AsIs)
        writer.Write(str(path))
    if unit != "MM":
        text, count = MILLIMETRE.subn(lambda found: UNITS[unit].format(found[1]), path.read_text())
        assert count == 1
        path.write_text(text)
    return path


def solid_of(lens):
    """Return what the text of a lens's STEP file holds."""
    return brep_of_text(step_bytes(lens).decode())


def rational_torus(path):
    """Write a quarter of a torus as NURBS, complex entities with weights, and return the path."""
    torus = BRepPrimAPI_MakeTorus(10.0, 3.0, 0.5, 1.25, 1.5).Shape()
    return written(BRepBuilderAPI_NurbsConvert(torus, True).Shape(), path)


def turned_at_random(shape):
    """Return a shape turned and moved."""
    turn = gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 1)), 0.7)
    return BRepBuilderAPI_Transform(shape, turn, True).Shape()


SOLIDS = {
    "plate with a spherical top": lambda: BRepAlgoAPI_Common(
        BRepPrimAPI_MakeSphere(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 1, 0)), 5.0).Solid(),
        BRepPrimAPI_MakeBox(gp_Pnt(-2, -3, 1), 4.5, 6.0, 9.0).Solid(),
    ).Shape(),
    "cone with a bore": lambda: BRepAlgoAPI_Cut(
        BRepPrimAPI_MakeCone(3.0, 1.0, 5.0).Solid(), BRepPrimAPI_MakeCylinder(0.5, 9.0).Solid()
    ).Shape(),
    "cone cut by a plane along its axis": lambda: BRepAlgoAPI_Common(
        BRepPrimAPI_MakeCone(3.0, 1.0, 5.0).Solid(),
        BRepPrimAPI_MakeBox(gp_Pnt(-9, -9, -1), 18.0, 9.5, 9.0).Solid(),
    ).Shape(),
    "cylinder cut aslant": lambda: BRepAlgoAPI_Cut(
        BRepPrimAPI_MakeCylinder(2.0, 5.0).Solid(),
        BRepPrimAPI_MakeBox(gp_Ax2(gp_Pnt(0, -9, 4), gp_Dir(1, 0, 1)), 9.0, 18.0, 9.0).Solid(),
    ).Shape(),
    "rational splines": lambda: BRepBuilderAPI_NurbsConvert(
        BRepPrimAPI_MakeCone(3.0, 1.0, 5.0, 2.5).Solid(), True
    ).Shape(),
}
