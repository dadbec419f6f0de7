"""Heights of faces along the axis of a lens, by OCCT's intersection with lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt
from OCP.IntCurvesFace import IntCurvesFace_Intersector

from thbcad.cad.foreign.surveyed_faces import SurveyedFace
from thbcad.checks import Floats
from thbcad.poses import Pose

TOLERANCE = 1e-6  # mm: rays through the rim count
FARTHEST = 1e6  # mm along a line


def axial_heights(faces: Sequence[SurveyedFace], frame: Pose, x: Floats, y: Floats) -> Floats:
    """Return z of the faces at positions (x, y) of the frame, (n,), NaN where they have none, mm.

    About 0.1 ms per position and face.
    """
    intersectors = [IntCurvesFace_Intersector(face.face, TOLERANCE) for face in faces]
    direction = gp_Dir(*frame.rotation[:, 2].tolist())
    starts = frame.points(np.stack([x, y, np.zeros(len(x))])).T
    heights = np.full(len(x), np.nan)
    for k, start in enumerate(starts.tolist()):
        line = gp_Lin(gp_Pnt(*start), direction)
        for intersector in intersectors:
            intersector.Perform(line, -FARTHEST, FARTHEST)
            if intersector.IsDone() and intersector.NbPnt():
                heights[k] = intersector.WParameter(1)
                break
    return heights
