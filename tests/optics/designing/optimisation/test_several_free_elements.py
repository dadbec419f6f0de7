"""Several free elements, whose surfaces are optimised together."""

import re

import numpy as np
import pytest
from PIL import Image, ImageFilter

import optics
from optics import Design, design
from optics.base.runtime import UserError
from optics.designing.optimisation import earlier_state, penalised_objective, stages
from optics.designing.optimisation.level_objective import can_cross, stage_film
from optics.designing.optimisation.loop import nearest_shapes
from optics.light.engines import ExactEngine
from optics.scene.problem import Problem
from optics.scene.system import System, other_limit_checks, solvable_system
from tests.cases import ROOT
from tests.optics.cases import rough
from tests.optics.designing.optimisation.cases import slope_at_0
from thbcad.surfaces import THBSurface

FREE = {"spans": (4, 4), "max_level": 1, "z_freedom": 2.0}
LENS = {
    "kind": "lens",
    "name": "L1",
    "position": (0, 0, 20),
    "index": 1.5,
    "thickness": 6.0,
    "front": {"half_width": (10.0, 10.0)},
    "rear": {"half_width": (10.0, 10.0), "radius": 60.0, "conic": -1.0, "freeform": FREE},
}
FACE = {"half_width": (12.0, 17.0), "radius": -300.0, "freeform": FREE}
MIRROR = {
    "kind": "mirror",
    "name": "M1",
    "position": (0, 0, 60),
    "tilt": (45, 0, 0),
    "thickness": 6.0,
    "face": FACE,
}


def problem(*elements, **more):
    """Return a problem of elements in a beam, and of a square lit 40 mm beside the last."""
    target = {"position": (0, 40, 60), "tilt": (-90, 0, 180), "half_width": (8.0, 8.0), "pixels": (32, 32)}
    return Problem(
        source={"kind": "collimated", "half_width": (8, 8), "distance": 40.0},
        element=elements,
        target={"kind": "tophat", **target} | more.pop("target", {}),
        optimizer={"iterations": (25,), **more.pop("optimizer", {})},
        **more,
    )


def with_free(element, face, freeform):
    return element | {face: element[face] | {"freeform": freeform}}


def waves(space, height):
    return THBSurface(space, rough(space, height))


def test_sags_come_in_the_order_of_the_light_whatever_the_order_of_the_file():
    for elements in ([LENS, MIRROR], [MIRROR, LENS]):
        path = [{"faces": ("L1.front", "L1.rear", "M1")}]
        system = System(problem(*elements, path=path))
        assert system.problem.optic.called == "M1"
        assert [optic.called for optic, _ in system.free_elements] == ["L1", "M1"]
        sags = [waves(sag.space, h) for sag, h in zip(system.sags, (0.1, 0.2))]
        shaped = system.with_sags(sags)
        lens = shaped.designed
        assert shaped.with_lens(lens).path.sags == sags
        assert lens.front.sag is sags[1]
        assert shaped.shapes["L1"].rear.sag is sags[0]
        assert not system.shapes


@pytest.mark.parametrize("limits", [{}, {"radius": 100.0, "slope": 8.0}], ids=["free", "limited"])
def test_the_loss_over_several_elements_has_the_slopes_of_differences(backend, limits):
    """Five-point differences along a rough direction; the limits are exceeded in both elements."""
    system = System(problem(LENS, MIRROR, limits=limits))
    sags = [waves(sag.space, 0.02) for sag in system.sags]
    shaped = system.with_sags(sags)
    lens = shaped.designed
    stage = stages(system, False)[-1]
    light = ExactEngine(backend).model(shaped.with_lens(lens), stage_film(shaped, stage))
    loss = penalised_objective(shaped.with_lens(lens), light, system.target.irradiance(stage.screen, 1.0))
    at, along = ([rough(s.space, h, 3) for s in sags] for h in (0.02, 1.0))
    slope = sum(float(g @ d) for g, d in zip(loss(at).gradients, along))
    for part in (0, 1):
        assert np.abs(loss(at).gradients[part]).max() > 0

    def moved(step):
        return loss([c + step * d for c, d in zip(at, along)]).loss

    # limits begin with a kink of the second derivative
    assert slope_at_0(moved, 1e-6) == pytest.approx(slope, rel=1e-8)
    if limits:
        assert loss.shape is not None
        for sag, of_sag in zip(sags, loss.shape([s.coefficients for s in sags])[1]):
            assert of_sag.any(), sag


def test_the_limits_of_each_element_are_checked_under_its_name():
    """A wave of 0.5 mm has radii of some mm: too small in both."""
    system = System(problem(LENS, MIRROR, limits={"radius": 20.0}))
    sags = [waves(sag.space.uniform(1), 0.5) for sag in system.sags]
    shaped = system.with_sags(sags)
    (check,) = other_limit_checks(shaped)
    assert check.name.startswith("L1: radius of the rear short of limits.radius")
    assert not check.ok
    assert all(c.ok for c in other_limit_checks(system))


def test_an_element_whose_surfaces_can_cross_is_told_from_one_that_has_room():
    thin = LENS | {"thickness": 1.5}
    system = System(problem(thin, MIRROR))
    assert can_cross(system) == [True, False]


@pytest.mark.parametrize(
    ("element", "words"),
    [
        (
            LENS | {"rear": LENS["rear"] | {"radius": "auto"}},
            "element.L1.rear.radius and element.L1.rear.conic must",
        ),
        (
            LENS | {"rear": LENS["rear"] | {"freeform": FREE | {"z_freedom": "auto"}}},
            "element.L1.rear.freeform.z_freedom must be a number of mm",
        ),
    ],
)
def test_only_the_last_free_surface_gets_its_base_from_the_light(element, words):
    with pytest.raises(UserError, match=re.escape(words)) as caught:
        problem(element, MIRROR)
    assert str(caught.value).count("\n") == 0


def test_a_script_s_map_takes_one_free_element():
    with pytest.raises(UserError, match=r"one free element, got element.L1 and element.M1; optics.design"):
        optics.System(problem(LENS, MIRROR))


def test_an_earlier_design_gives_every_element_its_sag():
    system = solvable_system(problem(LENS, MIRROR))
    sags = [waves(sag.space, 0.05) for sag in system.sags]
    shaped = system.with_sags(sags)
    lens = shaped.designed
    assert earlier_state(system, lens, shaped.shapes).sags == tuple(sags)
    alone = earlier_state(system, lens).sags
    assert alone[1] is sags[1]
    assert not alone[0].coefficients.any()


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """What makes a problem's target a picture with more detail than one coarse net has room for."""
    path = tmp_path_factory.mktemp("shown") / "pearl.png"
    picture = Image.open(ROOT / "examples" / "pearl.png").convert("L")
    picture.filter(ImageFilter.GaussianBlur(20)).resize((48, 48)).save(path)
    return {
        "target": {"kind": "image", "image": str(path), "pixels": (48, 48)},
        "optimizer": {"iterations": (60,)},
    }


@pytest.mark.slow
def test_two_free_elements_are_better_than_either_alone(shown, tmp_path):
    """And their result is whole: files, checks, and the light of what is read back."""
    fine = FREE | {"spans": (7, 7), "max_level": 2}
    first, last = (with_free(element, face, fine) for element, face in ((LENS, "rear"), (MIRROR, "face")))
    both = design(problem(first, last, **shown))
    lens = design(problem(first, with_free(last, "face", None), **shown))
    mirror = design(problem(with_free(first, "rear", None), last, **shown))
    assert both.metrics["rel_l2"] < 0.75 * min(lens.metrics["rel_l2"], mirror.metrics["rel_l2"])
    assert both.metrics["dof"] > max(lens.metrics["dof"], mirror.metrics["dof"])
    assert all(np.abs(sag.coefficients).max() > 0.01 for sag in both.system.sags)
    checks = both.verify()["checks"]
    assert [c["name"] for c in checks if c["result"] != "passed" and c["subject"] == "file"] == []
    assert any(c["name"].startswith("L1: ") for c in checks)
    folder = both.save(tmp_path / "both")
    assert {path.name for path in folder.glob("figures/L1_*")} == {"L1_rear_sag.png", "L1_rear_mesh.png"}
    read = Design.load(folder)
    assert read.system.shapes["L1"].rear.sag == both.system.shapes["L1"].rear.sag
    np.testing.assert_array_equal(read.irradiance, both.irradiance)
    del read.__dict__["measurement"]
    np.testing.assert_array_equal(read.irradiance, both.irradiance)
    (tmp_path / "both" / "L1.lens.json").unlink()
    with pytest.raises(UserError, match=r"L1\.lens\.json"):
        Design.load(tmp_path / "both")


def test_the_element_whose_surfaces_cross_is_named():
    system = System(problem(LENS, MIRROR))
    own, other = system.sags
    through = THBSurface(own.space, np.full(own.space.dim, -7.0))
    _, wrong = nearest_shapes(system, [through, other])
    assert wrong.startswith("the optimised lens cannot exist (L1: the surfaces")
