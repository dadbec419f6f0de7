"""A shape written as STEP by OpenCASCADE itself."""

from __future__ import annotations

from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer


def written(shape, path, unit="MM"):
    """Write a shape in a unit of OCCT's and return the path."""
    STEPControl_Writer()  # OCCT's settings exist only once a writer has been made
    before = Interface_Static.CVal_s("write.step.unit")
    Interface_Static.SetCVal_s("write.step.unit", unit)
    try:
        writer = STEPControl_Writer()
        writer.Transfer(shape, STEPControl_AsIs)
        writer.Write(str(path))
    finally:
        Interface_Static.SetCVal_s("write.step.unit", before)
    return path
