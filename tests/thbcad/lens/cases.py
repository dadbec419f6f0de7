"""Freeform surfaces with flat and with wavy sags."""

import numpy as np

from thbcad.hierarchy import THBSpace
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.lens import Lens
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


def flat_sag(value=0.0, degree=3, spans=4):
    kv = KnotVector.uniform(degree, spans)
    space = THBSpace(kv, kv)
    return THBSurface(space, np.full(space.dim, value))


def plano(rear, thickness=5.0):
    return Lens(FreeformSurface(rear.half_width), rear, thickness, 1.5)
