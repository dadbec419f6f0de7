"""Light within pixels, where the finest spans are narrower: parts of pixels, and what differs in them."""

import numpy as np
import pytest
from PIL import Image

from optics.base.runtime import load_backend
from optics.designing.optimisation.level_objective import stage_objective
from optics.designing.optimisation.objective import WITHIN
from optics.designing.optimisation.stage_plan import stages
from optics.light.analysis import measure
from optics.light.engines import ExactEngine
from optics.scene.system import solvable_system
from tests.optics.cases import flat_problem, small_system
from tests.optics.designing.optimisation.cases import designed, slope_at_0

FORMULA = {"target.kind": "function", "target.formula": "exp(-2*r^2) + 0.3", "target.pixels": [24, 24]}


def fine_stages(pixels=16, kind="tophat", **target):
    """Return the system and the stages of a lens with 40 spans, of which 38 are lit."""
    rear = {"half_width": (10, 10), "freeform": {"spans": (5, 5), "max_level": 3, "z_freedom": 2.0}}
    beam = {"kind": "collimated", "half_width": (9.5, 9.5)}
    asked = {"pixels": (pixels, pixels) if isinstance(pixels, int) else pixels, "kind": kind} | target
    system = solvable_system(flat_problem(beam, asked, {"rear": rear}))
    return system, stages(system, True)


@pytest.mark.parametrize(("pixels", "parts"), [(64, 1), (38, 1), (37, 2), (16, 3), (8, 6)])
def test_parts_are_about_as_narrow_as_spans(pixels, parts, tmp_path):
    """Three quarters of a span; pixels of a picture that are as wide as the spans have none, others two."""
    Image.new("L", (8, 8), 128).save(tmp_path / "grey.png")
    picture = {"kind": "image", "image": str(tmp_path / "grey.png")}
    for target, made in ((picture, parts), ({"kind": "tophat"}, max(parts, 2))):
        _, plan = fine_stages(pixels, **target)
        assert {stage.parts for stage in plan if stage.final} == {made}
        assert plan[-1].pixels == [pixels, pixels]
        assert plan[-1].screen.pixels == (made * pixels, made * pixels)
        assert {stage.parts for stage in plan[:-2]} == {1}


def test_parts_of_a_strip_do_not_fill_the_memory():
    """A pixel has at most six in each direction, and all pixels 2048."""
    assert fine_stages((200, 2))[1][-1].screen.pixels == (1200, 12)
    assert fine_stages((700, 2))[1][-1].parts == 2
    assert fine_stages((2049, 2))[1][-1].parts == 1


TARGETS = [
    {"kind": "tophat", "shape": "ellipse", "lit": (0.7, 0.9)},
    {"kind": "tophat", "lit": (0.55, 0.7)},
    {"kind": "function", "formula": "where(r<0.7,1,0.1)"},
    {"kind": "function", "formula": "(abs(x)+abs(y)<0.8)*1.0"},
]


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: "".join(map(str, target.values())))
def test_parts_ask_for_the_light_of_their_pixels(target):
    """The means over parts are the light asked for on the pixels."""
    system, plan = fine_stages(**target)
    screen, parts = plan[-1].screen, plan[-1].parts
    asked = system.target.irradiance(system.target.screen(), 2.0)
    means = system.target.irradiance(screen, 2.0).reshape(16, parts, 16, parts).mean(axis=(1, 3))
    np.testing.assert_allclose(means, asked, atol=1e-12 * asked.max())


def test_what_differs_within_pixels_counts_less():
    """The slope of the loss is that of differences; checks of one part are charged WITHIN of a ramp's."""
    system, plan = fine_stages()
    stage, flux = plan[-1], system.problem.flux
    target = system.target.irradiance(stage.screen, flux)
    loss = stage_objective(system, stage, target, ExactEngine(load_backend("double", 1)))
    rng, dim = np.random.default_rng(2), system.base.rear.sag.space.dim
    at, along = 0.05 * rng.normal(size=dim), rng.normal(size=dim)
    found = slope_at_0(lambda step: loss([at + step * along]).loss, 1e-5)
    assert found == pytest.approx(float(loss([at]).gradients[0] @ along), rel=1e-6)
    within = np.tile([1.0, 0.0, -1.0], (loss.target.shape[0], loss.target.shape[1] // 3))
    np.testing.assert_allclose(loss._weighted(within), WITHIN * within, atol=1e-15)
    np.testing.assert_allclose(loss._weighted(within, 0.5), WITHIN**0.5 * within, atol=1e-15)
    assert loss.image([at]).shape == (16, 16)
    by_pixel = np.repeat(np.arange(loss.target.shape[1] // 3.0), 3) * np.ones((len(loss.target), 1))
    np.testing.assert_allclose(loss._weighted(by_pixel), by_pixel, rtol=1e-14)


@pytest.mark.slow
def test_light_is_as_smooth_within_pixels_as_asked_for(tmp_path, backend):
    """On pixels a quarter as wide the same lens has little more: 56 spans on 24 pixels (0.025 without)."""
    rear = {"lens.rear.freeform.spans": [7, 7], "lens.rear.freeform.max_level": 3}
    rear |= {"lens.rear.freeform.z_freedom": 5.0, "optimizer.iterations": [24]}
    system = small_system(tmp_path, FORMULA | rear)
    lens = designed(system, backend).lens
    fine = small_system(tmp_path, FORMULA | rear | {"target.pixels": [96, 96]})
    off = [measure(s.with_lens(lens), backend).metrics["rel_l2"] for s in (system, fine)]
    assert off[0] < 0.001
    assert off[1] < 0.008


@pytest.mark.slow
def test_the_border_of_light_lies_where_it_is_asked_for(backend):
    """Also within the outermost pixels, which are narrower than the spans of a free front (0.19 without)."""
    front = {"half_width": (10, 10), "radius": 40.0, "conic": -1.0}
    front |= {"freeform": {"spans": (6, 6), "max_level": 1, "z_freedom": 2.0}}
    rear = {"half_width": (10, 10), "radius": -120.0, "conic": 0.0, "freeform": False}
    beam = {"kind": "collimated", "half_width": (9.5, 9.5)}
    asked = {"kind": "function", "formula": "1 + 0.5*x + 0.3*y*x + 0.2*y", "half_width": (20.0, 15.0)}
    system, fine = (
        solvable_system(
            flat_problem(beam, asked | {"pixels": (n, n), "distance": 100.0}, {"front": front, "rear": rear})
        )
        for n in (32, 128)
    )
    lens = designed(system, backend).lens
    off = [measure(s.with_lens(lens), backend).metrics["rel_l2"] for s in (system, fine)]
    assert off[0] < 0.015
    assert off[1] < 0.09
