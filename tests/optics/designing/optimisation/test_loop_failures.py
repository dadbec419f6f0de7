"""The design loop where it fails: each cause is named."""

import numpy as np
import pytest

from optics.base.runtime import NumericalError, UserError
from optics.designing.optimisation.loop import shape_lens, transmitted_flux
from optics.designing.optimisation.state import State
from optics.light.engines import ExactEngine
from optics.scene.problem import Problem
from optics.scene.system import solvable_system
from tests.optics.cases import small_system
from tests.optics.designing.optimisation.cases import FLAT
from thbcad.surfaces import THBSurface


def test_a_loss_that_is_not_finite_is_named(tmp_path, backend):
    system = small_system(tmp_path, FLAT)
    system.target.light[3, 4] = np.nan  # which no picture file can bring in
    with pytest.raises(NumericalError, match=r"the loss is not finite at level 0"):
        shape_lens(system, backend, ExactEngine(backend))


def test_surfaces_that_cross_are_named_with_the_remedy(small, backend):
    sag = small.system.base.rear.sag
    deep = THBSurface(sag.space, np.full(sag.space.dim, -7.0))
    with pytest.raises(
        NumericalError,
        match=r"cannot exist: the surfaces cross: at x = .* mm before the front.*lower z_freedom of the "
        r"free surfaces",
    ):
        shape_lens(small.system, backend, ExactEngine(backend), State(False, 0, (deep,)))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"lens.rear.radius": 0.3},
            r"only .* W of 1 W pass the unoptimised lens: 9\d% of the light is reflected totally at the "
            r"rear.*change the lens prescription",
        ),
        ({"lens.absorption": 10.0}, r"lens: 96% of the light is absorbed in the lens; change"),
    ],
)
def test_a_lens_that_lets_no_light_through_is_refused(tmp_path, backend, changes, words):
    with pytest.raises(UserError, match=words):
        shape_lens(small_system(tmp_path, changes), backend, ExactEngine(backend))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"position": (100, 0, 0)}, "100% of the light misses M1.face; move element.M1"),
        ({"position": (0, -14, 0)}, "100% of the light misses M1.face; move element.M1"),
        ({"reflectance": 0.0}, "100% of the light is absorbed at M1.face"),
        (
            {"clear_aperture": (9, 0.001), "position": (0, 6, 0)},
            "% of the light is blocked on its way to M1.face",
        ),
    ],
)
def test_light_that_goes_nowhere_is_said_by_face(backend, changes, words):
    mirror = {
        "kind": "mirror",
        "name": "M1",
        "tilt": (45, 0, 0),
        "thickness": 4,
        "face": {"half_width": (10, 10)},
    }
    target = {"kind": "tophat", "position": (0, 60, 0), "tilt": (-90, 0, 0), "half_width": (20, 20)}
    beam = {"kind": "collimated", "half_width": (9.5, 6.5)}
    problem = Problem(source=beam, element=[mirror | changes], target=target | {"pixels": (32, 32)})
    with pytest.raises(UserError, match="only 0 W of 1 W pass the unoptimised mirror") as caught:
        transmitted_flux(solvable_system(problem), backend)
    assert words in str(caught.value)


@pytest.mark.parametrize(("front", "rear"), [((10.0, 10.0), (8.0, 8.0)), ((8.0, 8.0), (10.0, 10.0))])
@pytest.mark.parametrize("radius", [np.inf, 60.0])
def test_fronts_and_rears_of_different_size_design_too(tmp_path, backend, front, rear, radius):
    changes = FLAT | {
        "lens.front.half_width": list(front),
        "lens.rear.half_width": list(rear),
        "lens.front.radius": radius,
        "lens.rear.freeform.max_level": 0,
    }
    _, state = shape_lens(small_system(tmp_path, changes), backend, ExactEngine(backend))
    assert min(r.loss for r in state.history) < state.history[0].loss


def test_transmitted_flux_of_a_plate(tmp_path, backend):
    system = small_system(tmp_path, {"lens.rear.radius": np.inf, "source.flux": 2.0})
    assert transmitted_flux(system, backend) == pytest.approx(2 * 0.96**2, rel=1e-12)
