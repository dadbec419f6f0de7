"""Indications of lenses with a body and of round ones, from what a problem says of them."""

import pytest

from optics.base.runtime import UserError
from optics.exchange.export.indications import indications_of
from optics.exchange.export.sheet_facts import SheetFacts, rounded_down
from optics.scene.problem import load_problem
from optics.scene.system import OpticalSystem
from tests.cases import EXAMPLES
from tests.optics.cases import write_problem


def facts_of(path, changes=None):
    system = OpticalSystem(load_problem(path, changes or {}))
    return SheetFacts(system, system.lens, "0" * 64, {"front": 0.0, "rear": 0.0}, None)


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
