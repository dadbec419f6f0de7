"""Indications of lenses with a body and of round ones, from what a problem says of them."""

from dataclasses import replace

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.exchange.export.indications import indications_of
from optics.exchange.export.sheet_facts import SheetFacts, rounded_down
from optics.scene.problem import Problem, load_problem
from optics.scene.system import System
from tests.cases import EXAMPLES
from tests.optics.cases import write_problem
from thbcad.surfaces import THBSurface


def facts_of(path, changes=None):
    system = System(load_problem(path, changes or {}))
    return SheetFacts(system, "0" * 64, {"front": 0.0, "rear": 0.0}, None)


@pytest.fixture(scope="module")
def dome():
    base = {"lens.rear.radius": -20.0, "lens.rear.conic": -1.0, "lens.rear.freeform.z_freedom": 1.0}
    return facts_of(EXAMPLES / "dome.toml", base)


def test_the_body_of_the_file_is_a_fact(dome):
    found = {one.name: (one.value, one.origin) for one in indications_of(dome, "moulded", {})}
    assert found["draft"] == ("3 degrees", "computed")
    assert found["radii"] == ("R 0.3 mm", "computed")
    land = float(dome.lens.front(5.0, 0.0)) - 0.1  # that far outside of the rim
    assert found["parting_line"] == (f"z = {land:.4f} mm", "computed")
    for name in ("draft", "radii", "parting_line"):
        with pytest.raises(UserError, match=f"indication {name}: lens.step says"):
            indications_of(dome, "moulded", {name: "1"})


def test_without_a_body_walls_are_open_and_can_be_given(tmp_path):
    facts = facts_of(write_problem(tmp_path))
    found = {one.name: one.origin for one in indications_of(facts, "moulded", {"draft": "1 degree"})}
    walls = {"draft": "given", "radii": "customary", "parting_line": "open"}
    assert {name: found[name] for name in walls} == walls


def test_what_light_was_traced_with_is_computed(tmp_path):
    changes = {"lens.rear.slope_rms": 1e-3, "lens.front.reflectance": 0.02}
    facts = facts_of(write_problem(tmp_path, changes))
    found = {one.name: (one.value, one.origin) for one in indications_of(facts, "cut", {})}
    assert found["texture.rear"] == ("rms slope 0.001 rad at most", "computed")
    assert found["texture.front"] == ("P3", "customary")
    assert found["coating.front"] == ("reflects 0.02 of the light", "computed")


def test_test_points_of_a_round_lens_lie_in_its_clear_aperture(dome):
    for face, radius in (("front", 11 * 5 / 12), ("rear", 11.0)):
        x, y, z = dome.test_points(face)
        assert radius - 2e-3 < (x[-1] ** 2 + y[-1] ** 2) ** 0.5 <= radius
        assert z.shape == (5, 5)
        assert all(round(1e3 * a, 9).is_integer() for a in (*x.tolist(), *y.tolist()))


def test_a_gate_beside_the_dome_stands_beside_both_apertures(dome):
    assert indications_of(dome, "moulded", {"gate": "0,-11.5"})
    with pytest.raises(UserError, match="the point 6,0 lies in the clear aperture of the rear"):
        indications_of(dome, "moulded", {"gate": "6,0"})  # outside that of the front


@pytest.mark.parametrize(
    ("value", "text"), [(0.0129, "0.012"), (3.0, "3"), (129.0, "120"), (0.05 * 60, "3"), (0.0, "0")]
)
def test_tolerances_are_rounded_down(value, text):
    assert rounded_down(value) == text


def test_the_thickness_is_that_on_the_axis_where_sags_have_heights_too(tmp_path):
    facts = facts_of(write_problem(tmp_path))
    (rear,) = facts.lens.free_surfaces
    heights = THBSurface(rear.sag.space, np.full(rear.sag.space.dim, 0.25))
    raised = replace(facts, system=facts.system.with_sags([heights]))
    found = {one.name: one.value for one in indications_of(raised, "moulded", {})}
    assert found["thickness"].startswith("6.25 mm")
    assert found["coordinates"].endswith("rear from z = 6 mm")


def test_tolerances_of_an_element_bear_its_name():
    size = {"half_width": (10, 10)}
    lens = {"kind": "lens", "name": "L1", "index": 1.5, "thickness": 6, "front": size, "position": (0, 0, 9)}
    problem = Problem(
        source={"kind": "collimated", "half_width": (8, 8)},
        element=[lens | {"rear": size | {"radius": 40.0, "freeform": {"z_freedom": 1.0}}}],
        target={"kind": "tophat", "position": (0, 0, 60), "half_width": (4, 20), "pixels": (16, 16)},
    )
    system = System(problem)
    row = {"L1.thickness": {"amount": 0.05, "allowed": 0.012}, "L1.index": {"amount": 5e-4, "allowed": None}}
    known = {"missed_by_the_design": [], "tolerances": row}
    facts = SheetFacts(system, "0" * 64, {"front": 0.0, "rear": 0.0}, known)
    found = {one.name: (one.value, one.origin) for one in indications_of(facts, "cut", {})}
    assert found["thickness"] == ("6 mm +- 0.012 mm", "computed")
    assert found["index"][0].endswith("+- 0.0005")
