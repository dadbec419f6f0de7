"""What a body for a mould leaves free of its lens."""

import numpy as np
import pytest

from thbcad.lens import FreeformSurface, Lens
from thbcad.moulds import BodyOptions, MouldedBody
from thbcad.outlines import Outline
from thbcad.sags import Conic


def dome():
    """Return a round lens of a flat front, 9.4 mm wide, and a dome 23.4 mm wide."""
    front = FreeformSurface((4.7, 4.7), corners=(4.7, 4.7))
    return Lens(front, FreeformSurface((11.7, 11.7), Conic(-30.0, -1.0), corners=(11.7, 11.7)), 8.0, 1.5)


def test_upright_walls_leave_all_of_front_and_rear_free():
    lens = dome()
    whole = tuple(surface.outline.scaled((h, h)) for surface, h in ((lens.front, 4.7), (lens.rear, 11.7)))
    body = MouldedBody.of(lens, BodyOptions(annulus=True), whole)
    assert body.free == whole


@pytest.mark.parametrize("keys", [{"draft": 1.0}, {"edge_radius": 0.1}])
def test_tapered_walls_and_rounded_edges_do_not(keys):
    lens = dome()
    with pytest.raises(ValueError, match="eats the clear aperture"):
        MouldedBody.of(lens, BodyOptions(annulus=True, **keys), (lens.front.outline, lens.rear.outline))


def test_no_outline_larger_than_the_surface_is_left_free():
    lens = dome()
    with pytest.raises(ValueError, match="eats the clear aperture"):
        MouldedBody.of(
            lens, BodyOptions(annulus=True), (lens.front.outline, lens.rear.outline.scaled((11.8, 11.8)))
        )


@pytest.mark.parametrize(("radius", "edge"), [(20.0, 0.7), (-20.0, 0.7), (8.0, 0.9)])
def test_the_depth_of_a_rounded_edge_is_that_of_the_ball_between_wall_and_sphere(radius, edge):
    """The centre of the ball lies edge within the wall, at x = 5 - edge, and |radius| - edge from the centre
    of a convex sphere, |radius| + edge from that of a concave one: it touches at x |R| / (|R| -+ edge)."""
    round_ = {"corners": (5.0, 5.0)}
    front, rear = (FreeformSurface((5.0, 5.0), Conic(r), **round_) for r in (radius, -radius))
    lens = Lens(front, rear, 8.0, 1.5)
    touches = (5.0 - edge) * abs(radius) / (abs(radius) - np.copysign(edge, radius))
    body = MouldedBody.of(lens, BodyOptions(edge_radius=edge))
    for outline in body.free:
        assert outline.half_width == pytest.approx((touches, touches), abs=1e-5)
        assert outline.half_width[0] <= touches + 1e-8
    body.require_clear((Outline.ellipse((touches - 1e-4,) * 2),) * 2)
    with pytest.raises(ValueError, match="eats the clear aperture"):
        body.require_clear((Outline.ellipse((touches + 1e-6,) * 2),) * 2)
