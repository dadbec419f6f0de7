"""How small a lens may be, and what a cut costs, by closed forms of flat lenses."""

import numpy as np
import pytest

from optics.light.outgoing import cut_cost, least_half_widths
from optics.scene.problem import Problem
from optics.scene.system import System, solvable_system
from tests.optics.cases import flat_problem
from thbcad.outlines import Outline, Polygon


def flat(outline: str, **source: object) -> System:
    lamp = {"distance": 20, **source}
    return solvable_system(flat_problem(lamp, {"half_width": (4, 20)}, {"outline": outline}))


def test_a_rectangle_may_be_as_small_as_its_beam():
    system = flat("rectangle", kind="collimated", half_width=(8, 7))
    assert least_half_widths(system, system.backend) == {"front": (8, 7), "rear": (8, 7)}


def test_a_round_lens_before_a_point_may_be_as_small_as_its_cone():
    system = flat("round", kind="point", half_angle=15)
    least = least_half_widths(system, system.backend)
    front = 20 * np.tan(np.radians(15))
    rear = front + 6 * np.tan(np.arcsin(np.sin(np.radians(15)) / 1.5))
    assert least["front"] == pytest.approx((front, front), rel=1e-12)  # corners of cells lie on the cone
    assert least["rear"] == pytest.approx((rear, rear), rel=1e-12)


@pytest.mark.parametrize(
    ("cut", "area", "narrow"),
    [
        (Outline((5.0, 5.0), (5.0, 5.0)), 25 * np.pi, 2 * (4 * 3 + 25 * np.arcsin(0.8))),
        (Polygon(((-5.0, -5.0), (5.0, -5.0), (0.0, 5.0))), 50.0, 48.0),
    ],
)
def test_a_cut_costs_the_area_of_the_beam_beside_it(cut, area, narrow):
    """The target is 8 mm wide: what lands there has |x| <= 4 mm in the lens too."""
    system = flat("rectangle", kind="collimated", half_width=(8, 7))
    cost = cut_cost(system, system.backend, cut)
    cells = 10 * 512**-1.5  # rays at the border are right or wrong by chance
    assert cost.through == pytest.approx(1 - area / (4 * 8 * 7), abs=cells)
    assert cost.on_target == pytest.approx(1 - narrow / (4 * 4 * 7), abs=4 * cells)


def test_a_face_met_from_behind_has_points_in_the_elements_own_frame():
    """A lens whose rear is a mirror in a beam: what is cut away at y < 0 costs half of the light, not all."""
    size = {"half_width": (20, 20)}
    lens = {"kind": "lens", "name": "L1", "index": 1.5, "thickness": 8}
    lens |= {"front": size, "rear": size | {"reflectance": 0.9}}
    screen = {"kind": "tophat", "position": (0, 0, -200), "tilt": (180, 0, 0)} | size | {"pixels": (16, 16)}
    problem = Problem(
        source={"kind": "collimated", "half_width": (15, 15), "distance": 50},
        element=[lens],
        path=[{"faces": ["L1.front", "L1.rear:reflect", "L1.front"]}],
        target=screen,
    )
    system = System(problem)
    half = Polygon(((-20.0, 0.0), (20.0, 0.0), (20.0, 20.0), (-20.0, 20.0)))
    assert cut_cost(system, system.backend, half).through == pytest.approx(0.5, abs=5e-3)
