"""The model of scripts: its derivatives, its units, its refusals, and the loss of the project."""

import copy
import inspect
import pickle
import threading

import numpy as np
import pytest

import optics
from optics.scene.problem import load_problem
from tests.optics.cases import rough, write_problem

BOTH_FREE = {"lens.front.freeform": {"spans": [3, 2], "z_freedom": 1.0}}
FAR = {"target.distance": np.inf, "target.half_width": [12.0, 12.0]}
GLOWING = {"source.kind": "lambertian", "source.half_width": [0.5, 0.4], "source.distance": 20.0}
SUN = {"source.divergence_profile": "sun", "source.divergence": 2.0}
RAYS = (97, 93)


def small_system(folder, changes=None):
    return optics.System(load_problem(write_problem(folder, changes)))


def at_of(spaces):
    rows = spaces if isinstance(spaces, tuple) else (spaces,)
    vectors = tuple(rough(space, 0.03, k) for k, space in enumerate(rows))
    return vectors if isinstance(spaces, tuple) else vectors[0]


def moved(c, d, t):
    return tuple(a + t * b for a, b in zip(c, d)) if isinstance(c, tuple) else c + t * d


def dot(a, b):
    pairs = zip(a, b) if isinstance(a, tuple) else [(a, b)]
    return sum(float(x @ y) for x, y in pairs)


CASES = {
    "cells": ({}, "cells"),
    "pixel": ({}, "pixel"),
    "two free surfaces": (BOTH_FREE, "cells"),
    "far field": (FAR, "cells"),
    "glowing area": (GLOWING, "bspline"),
    "sun": (SUN, "bspline"),
}


@pytest.mark.parametrize("radius", [-30.5, -33.0, -45.0, 40.0])
def test_the_derivative_of_a_lens_that_focuses_on_a_corner_of_pixels_is_that_of_differences(radius):
    """Rays of the symmetric lens land exactly on lines between pixels, where the light has kinks: with the
    first radius the one-sided derivatives are -0.139 and 0.138, and their mean is -0.00037."""
    face = optics.Freeform(spans=(4, 4))
    problem = optics.Problem(
        title="focus",
        source=optics.Source(kind="collimated", half_width=(9.5, 9.5)),
        lens=optics.LensSpec(
            index=1.5,
            thickness=6.0,
            front=optics.Front(half_width=(10.0, 10.0)),
            rear=optics.Rear(half_width=(10.0, 10.0), radius=radius, freeform=face),
        ),
        target=optics.Target(kind="tophat", distance=60.0, half_width=(20.0, 20.0), pixels=(16, 16)),
    )
    system = optics.System(problem)
    space = system.space(level=0)
    model = system.model(space, (33, 33), "cells")
    c, d = np.zeros(space.dim), 1e-2 * np.random.default_rng(1).normal(size=space.dim)
    (_, gradient), h = model.loss(c), 1e-6
    one, two = ((model.loss(c + k * d)[0] - model.loss(c - k * d)[0]) / (2 * k) for k in (h, 2 * h))
    assert gradient @ d == pytest.approx(2 * one - two, rel=1e-3, abs=2e-6)  # at kinks differences err by h
    image, pull = model.vjp(c)
    assert pull(image) @ d == pytest.approx((image * model.jvp(c, d)[1]).sum(), rel=1e-10)


@pytest.mark.parametrize("name", CASES)
def test_derivatives_agree_with_each_other_and_with_differences(tmp_path, name):
    changes, window = CASES[name]
    system = small_system(tmp_path, changes)
    space = system.space(level=1)
    model, c = system.model(space, RAYS, window), at_of(space)
    d = moved(at_of(space), at_of(space), 1.0)
    weights = np.random.default_rng(3).standard_normal(model.shape)
    image, pull = model.vjp(c)
    again, slope = model.jvp(c, d)
    np.testing.assert_allclose(image, model(c), rtol=0, atol=1e-12 * image.max())
    np.testing.assert_allclose(again, image, rtol=0, atol=1e-12 * image.max())
    scale = np.linalg.norm(slope) * np.linalg.norm(weights)
    assert dot(pull(weights), d) == pytest.approx(np.vdot(slope, weights), abs=1e-11 * scale)
    h = 1e-6

    def loss(t):
        return model.loss(moved(c, d, t))[0]

    # extrapolated from two steps; the windows' third derivatives jump
    differences = (8 * (loss(h) - loss(-h)) - (loss(2 * h) - loss(-2 * h))) / (12 * h)
    value, gradient = model.loss(c)
    assert dot(gradient, d) == pytest.approx(differences, abs=1e-7 * abs(differences) + 1e-9 * value / h)


@pytest.mark.parametrize("name", ["cells", "two free surfaces", "glowing area"])
def test_vertex_gradients_move_planes_as_coefficients_do(tmp_path, name):
    """A plane lies both in the space of the sag and in that of the vertices."""
    changes, window = CASES[name]
    system = small_system(tmp_path, changes)
    space = system.space()
    model, c = system.model(space, RAYS, window), at_of(space)
    weights = np.random.default_rng(4).standard_normal(model.shape)
    pulled, vertices = model.vjp(c)[1](weights), model.vertex_gradients(c, weights, np.array([21, 31]))
    tuples = isinstance(space, tuple)
    for s, by_net, by_vertex in zip(*((row if tuples else (row,)) for row in (space, pulled, vertices))):
        x, y = (np.linspace(kv.start, kv.stop, n) for kv, n in ((s.kv_u, 21), (s.kv_v, 31)))
        u, v = np.meshgrid(s.kv_u.greville(), s.kv_v.greville(), indexing="ij")
        for plane in (lambda a, b: 1 + 0 * a, lambda a, b: a - 0.3 * b):
            wanted = by_net @ plane(u, v).ravel()
            got = np.sum(by_vertex * plane(x[:, None], y[None, :]))
            assert got == pytest.approx(wanted, abs=1e-9 * np.abs(by_net).sum() * np.ptp(x))


def test_the_flux_of_the_irradiance_is_that_of_the_trace(tmp_path):
    system = small_system(tmp_path)
    space = system.space()
    model = system.model(space, RAYS, "cells")
    lens = system.lens(space, np.zeros(space.dim))
    measured = system.measure(lens)
    area = system.target.screen().pixel_area
    assert model(np.zeros(space.dim)).sum() * area == pytest.approx(measured.metrics["efficiency"], rel=1e-3)
    assert model.target.shape == model.shape == (48, 48)


def test_the_far_field_is_in_watts_per_steradian(tmp_path):
    """Summed over solid angles the intensity gives the flux on the target."""
    system = small_system(tmp_path, FAR)
    space = system.space()
    intensity = system.model(space, RAYS, "cells")(np.zeros(space.dim))
    screen = system.target.screen()
    solid_angles = screen.projection() * screen.pixel_area * (np.pi / 180) ** 2
    measured = system.measure(system.lens(space, np.zeros(space.dim)))
    assert (intensity * solid_angles).sum() == pytest.approx(measured.metrics["efficiency"], rel=1e-3)
    np.testing.assert_allclose(measured.irradiance, intensity, rtol=0, atol=1e-3 * intensity.max())


def test_two_models_used_in_turn_give_the_bytes_of_each_alone(tmp_path):
    system = small_system(tmp_path)  # on one thread
    spaces = system.space(0), system.space(1)

    def models():
        return [system.model(space, RAYS, w) for space, w in zip(spaces, ("cells", "pixel"))]

    alone = [model.loss(at_of(space)) for model, space in zip(models(), spaces)]
    first, second = models()
    in_turn = [(second.loss(at_of(spaces[1])), first.loss(at_of(spaces[0])))[::-1] for _ in range(2)]
    for found in in_turn:
        for (loss, gradient), (wanted, slope) in zip(found, alone):
            assert loss == wanted
            assert gradient.tobytes() == slope.tobytes()


def test_models_may_be_called_from_several_threads(tmp_path):
    system = small_system(tmp_path)
    space = system.space(1)
    model, found = system.model(space, RAYS, "cells"), {}
    wanted = [model.loss((1 + k) * at_of(space))[0] for k in range(3)]

    def work(k):
        found[k] = model.loss((1 + k) * at_of(space))[0]

    threads = [threading.Thread(target=work, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [found[k] for k in range(3)] == wanted


class OldEngine:
    """An engine whose model takes a lens too, as before `System.designed`."""

    def model(self, system, lens, film):
        raise AssertionError


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda s, m, c: m(c[:-1]), r"must have the shape \(49,\) of its space, got \(48,\)"),
        (lambda s, m, c: m(np.zeros(100)), r"space.prolongation\(finer\) brings"),
        (lambda s, m, c: m(c * np.nan), "must be finite, got 49 numbers that are not"),
        (lambda s, m, c: m((c, c)), "must be a vector, got 2 of them"),
        (lambda s, m, c: m("abc"), "must be numbers, got str"),
        (lambda s, m, c: m.jvp(c, c[1:]), r"the direction of the free surface must have the shape \(49,\)"),
        (lambda s, m, c: m.vjp(c)[1](np.zeros((3, 3))), r"dL/dE must have the shape \(48, 48\)"),
        (lambda s, m, c: m.vertex_gradients(c, np.zeros((3, 3))), r"dL/dE must have the shape \(48, 48\)"),
        (lambda s, m, c: m.vertex_gradients(c, 0 * m.target, (1, 9)), "counts must be two whole numbers"),
        (lambda s, m, c: s.space(-1), "level must be a whole number from 0"),
        (lambda s, m, c: s.model(s.space(), rays=0), "rays must be two whole numbers"),
        (lambda s, m, c: s.model(s.space(), rays=(1 << 20, 1 << 20)), "take fewer"),
        (lambda s, m, c: s.model(s.space(), window="box"), "window must be one of 'cells', 'pixel'"),
        (lambda s, m, c: s.model(s.space(), engine="magic"), "engine must be one of 'exact'"),
        (lambda s, m, c: s.model(s.space(), engine=3), "engine must be a name or have the method model"),
        (lambda s, m, c: s.model(s.space(), engine=OldEngine()), r"takes \(system, film\); the lens is"),
        (lambda s, m, c: s.model((s.space(), s.space())), "space must be a THBSpace"),
        (lambda s, m, c: s.lens(s.space(), c - 50.0), "the lens cannot exist"),
        (lambda s, m, c: optics.System("pearl.toml"), "System takes a Problem"),
        (lambda s, m, c: optics.design("pearl.toml"), "design takes a Problem"),
        (lambda s, m, c: optics.design(s.problem, progress=3), "progress must be True, None or a function"),
    ],
    ids=lambda value: None if isinstance(value, str) else inspect.getsource(value).strip()[:60],
)
def test_bad_use_gets_one_sentence(tmp_path, call, sentence):
    system = small_system(tmp_path)
    space = system.space()
    model = system.model(space, (33, 33))
    with pytest.raises(optics.UserError, match=sentence) as caught:
        call(system, model, np.zeros(space.dim))
    assert "\n" not in str(caught.value)


def test_the_space_of_another_problem_is_refused(tmp_path):
    system, other = small_system(tmp_path), small_system(tmp_path, {"lens.rear.freeform.spans": [5, 5]})
    with pytest.raises(optics.UserError, match="the space of the free surface must refine the problem's own"):
        system.model(other.space())


def test_the_transport_start_is_near_the_light_asked_for(tmp_path):
    system = small_system(tmp_path)
    space = system.space(2)
    start = system.transport_start(space)
    model = system.model(space, RAYS, "cells")
    assert model.loss(start.coefficients)[0] < 0.2 * model.loss(np.zeros(space.dim))[0]


@pytest.mark.parametrize(
    ("spoilt", "message"),
    [
        (lambda x: x + 1j, "numbers must be real, got complex128"),
        (
            lambda x: x.view([("sag", float)]),
            "numbers must be plain, got records with the fields sag; take one",
        ),
        (lambda x: np.ma.array(x, mask=np.arange(x.size).reshape(x.shape) == 2), "must not be masked, got 1"),
    ],
    ids=["complex", "fields", "masked"],
)
def test_numbers_with_more_to_them_are_refused(tmp_path, spoilt, message):
    system = small_system(tmp_path)
    space = system.space()
    model, c = system.model(space, RAYS), at_of(space)
    _, pull = model.vjp(c)
    for call in (
        lambda: model(spoilt(c)),
        lambda: model.vjp(spoilt(c)),
        lambda: model.jvp(c, spoilt(c)),
        lambda: pull(spoilt(np.ones(model.shape))),
        lambda: model.loss(spoilt(c)),
        lambda: system.lens(space, spoilt(c)),
    ):
        with pytest.raises(optics.UserError, match=message):
            call()


@pytest.mark.parametrize("lens", [None, 3, "lens.json"])
def test_what_is_no_lens_is_not_measured(tmp_path, lens):
    with pytest.raises(
        optics.UserError, match=rf"measure takes a Lens, got {type(lens).__name__}; system\.lens"
    ):
        small_system(tmp_path).measure(lens)


COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda noun: pickle.loads(pickle.dumps(noun)),
}


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("name", "way"),  # each once in `make test`
    [
        pytest.param(name, way, marks=() if i == j else pytest.mark.slow)
        for i, name in enumerate(("cells", "two free surfaces", "glowing area"))
        for j, way in enumerate(COPIES)
    ],
)
def test_copies_of_systems_and_models_make_the_same_light(tmp_path, name, way):
    changes, window = CASES[name]
    system = small_system(tmp_path, changes | {"lens.rear.freeform.z_freedom": "auto"})
    space = system.space(level=1)
    model, c = system.model(space, RAYS, window), at_of(space)
    other, (whole, part) = COPIES[way](model), COPIES[way]((system, model))
    assert whole.problem == system.problem
    np.testing.assert_array_equal(other(c), model(c))
    np.testing.assert_array_equal(part.loss(c)[0], model.loss(c)[0])
    np.testing.assert_array_equal(whole.model(space, RAYS, window)(c), model(c))


def test_a_call_and_a_derivative_are_of_one_irradiance_where_the_rim_of_a_fixed_lens_cuts_cells():
    """Corners beside the rim lie on what goes on beyond it, in both."""
    half, face = (
        (25.0, 25.0),
        {"radius": -400.0, "conic": -1.0, "freeform": {"spans": (4, 4), "z_freedom": 1.0}},
    )
    mirror = {"kind": "mirror", "name": "M1", "tilt": (45, 0, 0), "thickness": 5.0}
    lens = {"kind": "lens", "name": "L1", "position": (0, 60, 0), "tilt": (-90, 0, 0), "thickness": 5.0}
    lens |= {
        "index": 1.5,
        "front": {"half_width": (12, 12)},
        "rear": {"half_width": (12, 12), "freeform": None},
    }
    problem = optics.Problem(
        source=optics.Source(kind="collimated", half_width=(19.5, 13.5), distance=80.0),
        element=(mirror | {"face": face | {"half_width": half}}, lens),
        target=optics.Target(
            kind="tophat", position=(0, 120, 0), tilt=(-90, 0, 0), half_width=(20, 20), pixels=(24, 24)
        ),
    )
    system = optics.System(problem)
    space = system.space()
    model = system.model(space, (33, 33), "cells")
    np.testing.assert_array_equal(model(np.zeros(space.dim)), model.vjp(np.zeros(space.dim))[0])
