"""Lenses with elliptic apertures, and surfaces compared bit for bit."""

import numpy as np
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.TopAbs import TopAbs_SOLID

from thbcad.cad.exchange import edges_of, explore, faces_of, optical_form
from thbcad.cad.shapes import Part, lens_part
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, optical_forms
from thbcad.sags import Conic, PlacedConic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


def rough(degree=(3, 3), spans=(7, 6), amplitude=0.05, seed=1):
    """A sag of random coefficients, refined in one corner."""
    space = THBSpace(*(KnotVector.uniform(p, n) for p, n in zip(degree, spans)))
    space = space.refine({0: [(i, j) for i in range(3) for j in range(3)]})
    return THBSurface(space, amplitude * np.random.default_rng(seed).uniform(-1, 1, space.dim))


CASES = {
    "round": (
        Lens(FreeformSurface((10, 8)), FreeformSurface((10, 8), Conic(150.0, -1.0), rough()), 5.0, 1.5),
        (7.0, 7.0),
    ),
    "flat": (
        Lens(FreeformSurface((10, 8)), FreeformSurface((10, 8), Conic(-90.0, -1.0), rough((4, 3))), 5.0, 1.5),
        (9.3, 4.1),
    ),
    "upright": (
        Lens(
            FreeformSurface((9, 9), Conic(60.0, -1.0), rough()),
            FreeformSurface((9, 9), Conic(-70.0, -1.0)),
            6.0,
            1.5,
        ),
        (4.0, 8.0),
    ),
    "touching": (
        Lens(FreeformSurface((6, 6), Conic(60.0, -1.0)), FreeformSurface((6, 6), Conic(), rough()), 6.0, 1.5),
        (6.0, 6.0),
    ),
    "front smaller": (
        Lens(FreeformSurface((5, 4), Conic(), rough()), FreeformSurface((7, 8), Conic(50.0, -1.0)), 6.0, 1.5),
        (4.5, 3.9),
    ),
    "rear smaller": (
        Lens(
            FreeformSurface((7, 8), Conic(), rough((2, 2))),
            FreeformSurface((4, 5), Conic(), rough()),
            6.0,
            1.5,
        ),
        (3.5, 4.9),
    ),
    "sphere": (
        Lens(
            FreeformSurface((5, 4), Conic(-40.0, 0.0)), FreeformSurface((5, 4), Conic(-60.0, -2.5)), 4.0, 1.5
        ),
        (3.0, 3.5),
    ),
}


def rounded_by_occt(lens, radius):
    """Return the Part of a lens whose rear's rim OCCT has rounded, with splines of degree 14."""
    part = lens_part(lens)
    fillets = BRepFilletAPI_MakeFillet(part.solid)
    fillets.SetParams(1e-2, 1e-4, 1e-5, 1e-8, 1e-8, 1e-3)
    for edge in edges_of(part.faces[1]):
        fillets.Add(radius, edge)
    solid = explore(fillets.Shape(), TopAbs_SOLID)[0]
    faces = faces_of(solid)
    forms = {k: form for k, form in enumerate(map(optical_form, faces)) if form is not None}
    optical = {
        k: form.vertex if isinstance(form, PlacedConic) else form.coefficients[..., 2].mean()
        for k, form in forms.items()
    }
    front, rear = sorted(optical, key=optical.get)
    names = ["front" if k == front else "rear" if k == rear else f"face {k}" for k in range(len(faces))]
    return Part(solid, names, faces)


def same_bits(a, b):
    """Splines, or conics with the numbers that files hold of them."""
    if isinstance(b, PlacedConic):
        return (a.numbers + 0.0).tobytes() == (b.numbers + 0.0).tobytes()
    rows = ((s.kv_u.knots, s.kv_v.knots, s.coefficients) for s in (a, b))
    return all(
        (x + 0.0).tobytes() == (y + 0.0).tobytes() for x, y in zip(*rows, strict=True)
    )  # 0.0 and -0.0 are the same place


def assert_whole(state, faces):
    """One closed solid of so many faces that meet within 1e-7 mm."""
    found = state.solids, state.faces, state.free_edges, state.closed, state.valid
    assert found == (1, faces, 0, True, True)
    assert state.tolerance <= 1e-7


def assert_sound(lens, part, read, faces):
    """A whole solid, named as built, with every number of front and rear."""
    assert_whole(read, faces)
    assert tuple(part.names) == tuple(read.face_names)
    for found, wanted in zip((read.front, read.rear), optical_forms(lens), strict=True):
        assert same_bits(found, wanted)
