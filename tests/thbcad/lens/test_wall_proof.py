"""Soundness of lenses whose corners are cut off, against closed forms and dense samples of the wall."""

import numpy as np
import pytest

from tests.thbcad.lens.cases import flat_sag
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.lens import Lens
from thbcad.lens.soundness import require_sound
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface


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


@pytest.mark.every(3)
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
