"""Soundness of lenses, corners cut off or not: proven at the doors, with the same sentence."""

import json
from functools import partial

import numpy as np
import pytest

from tests.thbcad.lens.cases import flat_sag
from thbcad import write_step
from thbcad.cad.exchange import (
    SolidState,
    brep_bytes,
    iges_bytes,
    named_faces,
    step_bytes,
    step_shape,
    to_build123d,
)
from thbcad.cad.shapes import flanged_part, lens_part, lens_solid, patched_part, trimmed_part
from thbcad.io import lens_from_dict, lens_to_dict, read_lens, write_lens
from thbcad.lens.cuts import Flange
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.lens import Lens
from thbcad.lens.soundness import require_sound
from thbcad.lens.triangulation import tessellated
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

CROSSING = {
    "surfaces": (FreeformSurface((3, 4)), FreeformSurface((3, 4), Conic(-10, -1)), 1.0),
    "edges": (FreeformSurface((8, 8), Conic(-5.0, -1.0)), FreeformSurface((5, 5), Conic(-5.0, -1.0)), 0.5),
}
SENTENCE = {
    "surfaces": r"the surfaces cross: at x = -?3, y = -?4 mm the rear lies 0\.25 mm before the front",
    "edges": r"the ruled edge at -x crosses the front: at x = \S+, y = \S+ mm it lies \S+ mm before it",
}
DOORS = {
    "step": step_bytes,
    "iges": iges_bytes,
    "brep": brep_bytes,
    "part": lens_part,
    "solid": lens_solid,
    "patches": patched_part,
    "aperture": partial(trimmed_part, semi_axes=(2.0, 2.0)),
    "flange": partial(flanged_part, flange=Flange(2.0, 0.2, 0.4)),
    "mesh": partial(tessellated, chord=1e-2),
    "native": lambda lens: lens_from_dict(lens_to_dict(lens)),
    "build123d": to_build123d,
    "faces": named_faces,
}


def test_a_sound_lens_is_returned():
    lens = Lens(FreeformSurface((3, 4)), FreeformSurface((3, 4), Conic(-10, -1)), 2.0, 1.5)
    assert require_sound(lens) is lens


@pytest.mark.parametrize("crossing", CROSSING)
@pytest.mark.parametrize("door", DOORS)
def test_doors_refuse_a_lens_that_crosses_itself(door, crossing):
    lens = Lens(*CROSSING[crossing], 1.5)
    with pytest.raises(ValueError, match=SENTENCE[crossing]):
        DOORS[door](lens)


@pytest.mark.parametrize("crossing", CROSSING)
def test_nothing_is_written_of_a_lens_that_crosses_itself(crossing, tmp_path):
    lens = Lens(*CROSSING[crossing], 1.5)
    for write, suffix in ((write_lens, ".json"), (write_step, ".step")):
        with pytest.raises(ValueError, match=SENTENCE[crossing]):
            write(lens, tmp_path / f"lens{suffix}")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "lens.json").write_text(json.dumps(lens_to_dict(lens)), "utf-8")
    with pytest.raises(ValueError, match=SENTENCE[crossing]):
        read_lens(tmp_path / "lens.json")


TINY = {
    "thickness": (Lens(FreeformSurface((3, 4)), FreeformSurface((3, 4)), 9e-7, 1.5), "9e-07 mm thick"),
    "rims": (
        Lens(FreeformSurface((3, 4)), FreeformSurface((3, 4), Conic(-12.5, -1.0)), 1.0 + 1e-9, 1.5),
        "1e-09 mm thick",
    ),
    "width": (Lens(FreeformSurface((4, 4e-7)), FreeformSurface((4, 4e-7)), 1.0, 1.5), "8e-07 mm wide"),
}


@pytest.mark.parametrize("tiny", TINY)
@pytest.mark.parametrize("door", DOORS)
def test_doors_refuse_a_lens_that_cad_files_cannot_hold(door, tiny):
    """CAD programs take points within 1e-7 mm of each other for one."""
    lens, sentence = TINY[tiny]
    with pytest.raises(
        ValueError, match=f"{sentence}, less than the 1e-06 mm that CAD files can hold; raise"
    ):
        DOORS[door](lens)


def test_the_thinnest_lens_is_a_solid_in_its_file(tmp_path):
    lens = Lens(FreeformSurface((3, 4)), FreeformSurface((3, 4)), 1.001e-6, 1.5)
    write_step(lens, tmp_path / "lens.step")
    read = SolidState(step_shape(tmp_path / "lens.step"))
    assert (read.solids, read.free_edges, read.closed, read.valid) == (1, 0, True, True)
    assert read.volume == pytest.approx(lens.volume(), rel=1e-6)


def test_something_else_is_refused():
    with pytest.raises(ValueError, match="lens must be a Lens, got str"):
        require_sound("lens")


def lens(front, rear, thickness, share=1.0):
    """front, rear : (half_width, radius) of paraboloids.  share : of the half-widths, of the corners."""
    surfaces = []
    for half, radius in (front, rear):
        half = np.broadcast_to(half, 2)
        surfaces.append(FreeformSurface(half, Conic(radius, -1.0), None, tuple(share * half)))
    return Lens(*surfaces, thickness, 1.5)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_corners_outside_the_outline_may_cross(share):
    """z = -r^2 / 20 falls 5 mm on the disk of 10 mm and 10 mm in the corners: 7 mm hold the disk alone."""
    made = lens((10.0, np.inf), (10.0, -10.0), 7.0, share)
    if share:
        assert require_sound(made) is made
        assert made.least_thickness().value == pytest.approx(2.0, abs=1e-12)
    else:
        with pytest.raises(
            ValueError, match=r"the surfaces cross: at x = -?10, y = -?10 mm the rear lies 3 mm"
        ):
            require_sound(made)


def test_a_disk_whose_rim_crosses_is_refused():
    with pytest.raises(ValueError, match=r"the surfaces cross: .* the rear lies 0\.1 mm before the front"):
        require_sound(lens((10.0, np.inf), (10.0, -10.0), 4.9))


def test_a_wall_leaves_the_rim_steeper_than_the_surface_over_it():
    """From r = 5, z = 2.5 the wall rises to r = 8, z = t + 3.2 below a rear that rises by 0.8 at its rim:
    where t + 0.7 > 3 * 0.8."""
    assert require_sound(lens((5.0, 5.0), (8.0, 10.0), 1.71))
    with pytest.raises(
        ValueError, match=r"the wall between the rims crosses the rear .* by more than 0\.1 mm"
    ):
        require_sound(lens((5.0, 5.0), (8.0, 10.0), 1.6))
    with pytest.raises(ValueError, match="crosses itself"):
        require_sound(lens(((8.0, 5.0), -5.0), ((5.0, 6.0), -5.0), 4.0))


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.3, 1.0])
@pytest.mark.parametrize(
    ("a", "b"), [((6.0, 6.0), (4.0, 4.0)), ((4.0, 4.0), (6.0, 4.0)), ((5.0, 3.0), (7.0, 6.0))]
)
def test_no_point_of_a_proven_wall_lies_beyond_the_surfaces(share, a, b):
    """The thinnest proven lens with a wavy front: points of its wall are at no surface's far side."""
    rng = np.random.default_rng(5)
    flat = flat_sag()
    sag = THBSurface(flat.space, 0.2 * rng.standard_normal(flat.space.dim))
    corners = [tuple(share * np.array(h)) for h in (a, b)]
    front = FreeformSurface(a, Conic(-9.0, -1.0), sag, corners[0])
    rear = FreeformSurface(b, Conic(-7.0, -1.0), None, corners[1])
    thin, thick = 0.0, 40.0
    while thick - thin > 0.02:
        middle = (thin + thick) / 2
        try:
            proven = require_sound(Lens(front, rear, middle, 1.5))
            thick = middle
        except ValueError:
            thin = middle
    angle, w = np.linspace(0, 2 * np.pi, 721), np.linspace(0, 1, 41)[1:-1, None]
    turn = np.stack([np.cos(angle), np.sin(angle)])
    e = np.sign(turn) * (1 - share + share * abs(turn))
    ends = [surface(*(e * np.reshape(h, (2, 1)))) for surface, h in ((front, a), (rear, b))]
    z = (1 - w) * ends[0] + w * (thick + ends[1])
    x, y = ((1 - w) * p * e_i + w * q * e_i for p, q, e_i in zip(a, b, e))
    for surface, vertex, side in ((front, 0.0, 1), (rear, thick, -1)):
        over = surface.outline.contains(x, y, -1e-9)
        assert (side * (z[over] - vertex - surface(x[over], y[over])) > 0).all()
    both = front.outline.contains(x, y, -1e-9) & rear.outline.contains(x, y, -1e-9)
    assert (thick + rear(x[both], y[both]) > front(x[both], y[both])).all()
    assert proven


def test_a_conic_that_ends_beyond_the_outline_says_so():
    with pytest.raises(
        ValueError, match=r"r = 12 mm, .* 14\.1421 mm: surfaces go on over the whole rectangle"
    ):
        FreeformSurface((10.0, 10.0), Conic(12.0), corners=(10.0, 10.0))
