"""Lenses to draw: plano-concave, wavy, of different sizes, and one of conics."""

import numpy as np
import pytest

from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


def wavy_sag(size, seed=0):
    space = THBSpace(KnotVector.uniform(3, 6), KnotVector.uniform(3, 5))
    return THBSurface(space, size * np.random.default_rng(seed).uniform(-1, 1, space.dim))


PLAIN = Lens(FreeformSurface((5, 4)), FreeformSurface((5, 4), Conic(40.0, -1.0)), 3.0, 1.5)
WAVY = Lens(FreeformSurface((5, 4)), FreeformSurface((5, 4), Conic(-40.0, -1.0), wavy_sag(0.4)), 3.0, 1.5)
WIDER = Lens(
    FreeformSurface((5, 4), Conic(30.0, -1.0), wavy_sag(0.1, 1)),
    FreeformSurface((8, 7), Conic(-40.0, -1.0), wavy_sag(0.2, 2)),
    5.0,
    1.5,
)
BALL = Lens(FreeformSurface((5, 4), Conic(12.0)), FreeformSurface((5, 4), Conic(-12.0, 0.5)), 5.0, 1.5)


def outlined(lens, share, scale=(1.0, 1.0)):
    """A lens with corners that are a share of its half-widths, and a front of another size."""
    surfaces = (
        FreeformSurface(half, s.conic, s.sag, tuple(np.multiply(share, half)))
        for s, half in (
            (lens.front, np.multiply(lens.front.half_width, scale)),
            (lens.rear, lens.rear.half_width),
        )
    )
    return Lens(*surfaces, lens.thickness, lens.index)


def area_of(line):
    """The area within a closed line (n, 2)."""
    x, y = line.T
    return abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def assert_section_area(lines, mesh, across, at, off):
    """Closed lines hold the area in which a plane x (across 0) or y (1) = at cuts a mesh, `off` mm beside."""
    normal = np.eye(3)[across]
    section = mesh.section(plane_origin=normal * (at + 1e-9), plane_normal=normal)  # beside its vertices
    by_trimesh = sum(area_of(np.delete(loop, across, axis=1)) for loop in section.discrete)
    length = sum(np.hypot(*np.diff(line, axis=0).T).sum() for line in lines)
    assert by_trimesh == pytest.approx(sum(map(area_of, lines)), abs=off * length)


def height_line(view, points):
    """Return points of a side or a section as (y, z) or (x, z), by the axes that the view says it has."""
    named = {axis[-1]: column * (-1 if axis[0] == "-" else 1) for axis, column in zip(view.axes, points.T)}
    return np.column_stack([named.get("x", named.get("y")), named["z"]])


LENSES = {"plano": PLAIN, "wavy": WAVY, "of two sizes": WIDER, "of conics": BALL}
