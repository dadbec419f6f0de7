"""Mounting flanges: volumes in closed form, solids that read back closed with every pole, refusals at
certified rims."""

from dataclasses import FrozenInstanceError
from fractions import Fraction

import build123d
import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.thbcad.cad.shapes.cases import CASES, assert_sound, rough
from thbcad.cad.exchange import part_step, read_step, solid_volume
from thbcad.cad.shapes.flange_solid import flanged_part
from thbcad.lens import (
    Flange,
    FreeformSurface,
    Lens,
    Product,
    aperture_volume,
    flanged_volume,
    require_clear,
    ruled_edges,
)
from thbcad.sags import Conic

FLANGE = Flange(2.5, 1.6, 3.1)
RECTANGULAR = {
    "plane edges": CASES["round"][0],
    "paraboloids": Lens(
        FreeformSurface((10, 8), Conic(90.0, -1.0)), FreeformSurface((10, 8), Conic(-90.0, -1.0)), 6.0, 1.5
    ),
    "front smaller": CASES["front smaller"][0],
    "rear smaller": CASES["rear smaller"][0],
    "longer along x": Lens(
        FreeformSurface((5, 4), Conic(-60.0, -1.0)), FreeformSurface((6, 4), Conic(), rough()), 4.0, 1.5
    ),
}
CUTS = {name: (lens, None) for name, lens in RECTANGULAR.items()} | {
    f"{name}, cut": CASES[name] for name in ("round", "upright", "front smaller", "touching")
}


@pytest.fixture(scope="module", params=CUTS)
def written(request, tmp_path_factory):
    """(lens, semi-axes, part, path, what was read back), written once for each lens."""
    lens, semi_axes = CUTS[request.param]
    part = flanged_part(lens, FLANGE, semi_axes)
    path = tmp_path_factory.mktemp("flange") / "lens.step"
    path.write_bytes(part_step(part, Product()))
    return lens, semi_axes, part, path, read_step(path)


# ---- solids ----


@pytest.mark.every(3)
def test_the_solid_is_closed_and_keeps_every_pole(written):
    lens, semi_axes, part, _, read = written
    assert_sound(lens, part, read, 10 if semi_axes else 16)


def test_names_of_the_faces():
    lens, semi_axes = CASES["round"]
    sides = ["-y", "+x", "+y", "-x"]
    edges = [f"edge {side} {end}" for end in ("front", "rear") for side in sides]
    names = [
        "front",
        "rear",
        *edges,
        "flange front",
        "flange rear",
        *(f"flange side {side}" for side in sides),
    ]
    assert list(flanged_part(lens, FLANGE).names) == names
    edges = ["edge 1 front", "edge 2 front", "edge 1 rear", "edge 2 rear"]
    names = ["front", "rear", *edges, "flange front", "flange rear", "flange side 1", "flange side 2"]
    assert list(flanged_part(lens, FLANGE, semi_axes).names) == names


@pytest.mark.every(3)
def test_volumes_agree(written):
    """As built and as read; the signed volume of the raw solid also tells that all normals point outward."""
    lens, semi_axes, part, _, read = written
    wanted = flanged_volume(lens, FLANGE, semi_axes)
    assert solid_volume(part.solid, 1e-6) == pytest.approx(wanted, rel=1e-6)
    assert solid_volume(read.shape, 1e-6) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.every(4)
def test_the_flange_has_its_planes_and_its_width(written):
    lens, semi_axes, _, path, _ = written
    solid = build123d.import_step(path).solids()[0]
    assert solid.is_valid
    halves = semi_axes or [max(pair) for pair in zip(lens.front.half_width, lens.rear.half_width)]
    planes = [
        f for f in solid.faces() if f.geom_type == build123d.GeomType.PLANE and len(f.inner_wires()) == 1
    ]
    assert sorted((round(f.normal_at().Z, 12), round(f.center().Z, 9)) for f in planes) == [
        (-1.0, FLANGE.low),
        (1.0, FLANGE.high),
    ]
    for face in planes:
        box = face.bounding_box(1e-9, optimal=True)
        corners = np.array([[box.min.X, box.min.Y], [box.max.X, box.max.Y]])
        # OCCT's boxes are larger by the tolerance of edges
        assert corners == pytest.approx(np.outer([-1, 1], np.add(halves, FLANGE.width)), abs=1e-6)


# ---- volumes ----


@given(st.floats(0.5, 5.0), st.floats(-0.13, 1.0), st.floats(0.2, 2.0))
def test_volume_round_a_lens_with_plane_edges(width, low, depth):
    """V_lens + (high - low) (outline - cross section); the aperture's rim reaches up to z = -25/180."""
    lens = Lens(
        FreeformSurface((10, 8), Conic(-90.0, -1.0)), FreeformSurface((10, 8), Conic(90.0, -1.0)), 6.0, 1.5
    )
    flange = Flange(width, low, low + depth)
    frame = 4 * ((10 + width) * (8 + width) - 80)
    assert flanged_volume(lens, flange) == pytest.approx(
        lens.volume() + (flange.high - flange.low) * frame, rel=1e-13
    )
    ring = np.pi * ((7 + width) * (5 + width) - 35)
    assert flanged_volume(lens, flange, (7, 5)) == pytest.approx(
        aperture_volume(lens, (7, 5)) + (flange.high - flange.low) * ring, rel=1e-13
    )


def test_volume_round_a_frustum():
    """Between planes the lens is a frustum with half-widths linear in z: exact rationals."""
    lens = Lens(FreeformSurface((5, 4)), FreeformSurface((7, 6)), 4.0, 1.5)
    low, high, width = Fraction(1), Fraction(5, 2), Fraction(3, 2)
    # integral of 4 (5 + z / 2) (4 + z / 2)
    primitive = [
        4 * (20 * z + Fraction(9, 4) * z**2 + z**3 / 12) for z in (Fraction(0), low, high, Fraction(4))
    ]
    whole, inner = primitive[3] - primitive[0], primitive[2] - primitive[1]
    exact = whole - inner + 4 * (7 + width) * (6 + width) * (high - low)
    assert flanged_volume(lens, Flange(1.5, 1.0, 2.5)) == pytest.approx(float(exact), rel=1e-14)


def test_ruled_edges_join_the_rims():
    lens = RECTANGULAR["rear smaller"]
    for panel, (x, y) in zip(ruled_edges(lens), [(0, -1), (1, 0), (0, 1), (-1, 0)], strict=True):
        share = np.linspace(-1, 1, 33)
        s = np.clip(share * panel.kv_u.stop, panel.kv_u.start, panel.kv_u.stop)
        for k, (surface, vertex) in enumerate(((lens.front, 0.0), (lens.rear, lens.thickness))):
            px, py, pz = np.moveaxis(panel.grid(s, [float(k)])[:, 0], -1, 0)
            a, b = surface.half_width
            assert px == pytest.approx(a * (x if x else share), abs=1e-13)
            assert py == pytest.approx(b * (y if y else share), abs=1e-13)
            assert pz == pytest.approx(vertex + surface(px, py), abs=1e-12)


# ---- refusals ----


@pytest.mark.parametrize("semi_axes", [None, (7.0, 5.0)])
def test_rims_limit_the_flange(semi_axes):
    """The front rises to its rim, the rear falls: the corners of the rectangle, the far end of the
    ellipse."""
    lens = RECTANGULAR["paraboloids"]
    reach = 164 if semi_axes is None else 49
    top, bottom = reach / 180, 6 - reach / 180
    require_clear(lens, Flange(1, top + 2e-6, bottom - 2e-6), semi_axes)
    with pytest.raises(
        ValueError, match=rf"flange low must lie above the front's rim, which reaches up to z = {top:.9g} mm"
    ):
        flanged_part(lens, Flange(1, top, bottom - 1), semi_axes)
    with pytest.raises(
        ValueError,
        match=rf"flange high must lie below the rear's rim, which reaches down to z = {bottom:.9g} mm",
    ):
        flanged_part(lens, Flange(1, top + 1, bottom), semi_axes)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((0.0, 1.0, 2.0), "flange width must be a finite number of at least 1e-06, got 0.0"),
        ((-1.0, 1.0, 2.0), "flange width must be a finite number of at least 1e-06, got -1.0"),
        ((1.0, np.nan, 2.0), "flange low must be a finite number, got nan"),
        ((1.0, 1.0, np.inf), "flange high must be a finite number, got inf"),
        ((1.0, 2.0, 2.0), "flange high must be at least 1e-06 mm above flange low = 2 mm, got 2 mm"),
        ((1.0, 2.0, 1.0), "flange high must be at least 1e-06 mm above flange low = 2 mm, got 1 mm"),
    ],
)
def test_refused_numbers(numbers, message):
    with pytest.raises(ValueError, match=message):
        Flange(*numbers)


def test_other_refusals():
    lens, _ = CASES["round"]
    with pytest.raises(ValueError, match="flange must be a Flange, got float"):
        flanged_part(lens, 1.0)
    with pytest.raises(ValueError, match="lens must be a Lens, got str"):
        flanged_part("lens", FLANGE)
    with pytest.raises(ValueError, match="semi_axes must be at most the front's half-widths"):
        flanged_part(lens, FLANGE, (10.5, 1.0))
    with pytest.raises(FrozenInstanceError):
        FLANGE.width = 1.0
