"""A shape written as STEP by OpenCASCADE itself."""

from __future__ import annotations

from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer


def written(shape, path):
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(str(path))
    return path
