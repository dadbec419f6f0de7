"""A luminaire lights what its intensity says: against quadrature without rays, and through plane windows."""

import numpy as np
import pytest

import optics
from optics.base.runtime import load_backend
from optics.light.analysis import sequential
from optics.light.analysis.light_of_rays import ray_irradiance
from optics.scene.luminaires import Luminaire, Opening, write_ies
from optics.scene.sources import PointSource, mirror_half
from tests.optics.cases import rough, small_problem
from tests.optics.light.analysis.cases import through_plate
from tests.optics.scene.luminaires.cases import asymmetric, lambertian, narrow

WINDOW = {"lens.rear.radius": np.inf, "lens.rear.conic": 0.0}

NEAR = {"source.distance": 3.0, "target.pixels": [8, 8]}
COARSE = WINDOW | {"target.pixels": [6, 6]}


@pytest.fixture(scope="module")
def lamp(tmp_path_factory):
    """A folder with the file of an asymmetric lamp."""
    folder = tmp_path_factory.mktemp("lamp")
    write_ies(asymmetric(Opening((3.0, 2.0))), folder / "lamp.ies")
    return folder


def lit(folder, **more):
    keys = {
        "source.kind": "luminaire",
        "source.file": "lamp.ies",
        "source.distance": 20.0,
        "source.half_width": [0.0, 0.0],
        "source.flux": 0.0,
    }
    return optics.System(small_problem(folder, keys | more))


def through_window(light, x, y, before, thickness, behind, index):
    """Return the irradiance of a point behind a plane window: no ray is traced.

    A direction of slope s = tan(theta) arrives at r = s (before + behind) + thickness tan(theta'), so that
    E = I T sin(theta) dtheta / (r dr).
    """
    slopes = np.linspace(0, 4, 400_001)
    theta = np.arctan(slopes)
    r = slopes * (before + behind) + thickness * np.tan(np.arcsin(np.sin(theta) / index))
    dr = np.gradient(r, theta)
    with np.errstate(invalid="ignore"):
        spread = np.sin(theta) / (r * dr)
    spread[0] = 1 / dr[0] ** 2
    at = np.hypot(x, y)
    gamma = np.interp(at, r, theta)
    passed = through_plate(gamma, index)
    c = np.degrees(np.arctan2(-y, x)) % 360
    return light.at(c, np.degrees(gamma)) * passed * np.interp(at, r, spread)


@pytest.mark.slow
def test_the_light_of_a_point_behind_a_window_is_that_of_quadrature(tmp_path):
    light = narrow()
    write_ies(light, tmp_path / "lamp.ies")
    system = lit(tmp_path, **WINDOW, **{"target.pixels": [24, 24]})
    assert system.problem.source.half_width == (0.0, 0.0)  # that of the file
    assert system.problem.source.flux == pytest.approx(light.flux, rel=1e-6)
    found, fates, _ = sequential(system, load_backend("double"), 724)
    fine = (np.arange(24 * 8) + 0.5) / (24 * 8) * 40 - 20
    x, y = np.meshgrid(fine, -fine)  # row 0 at +y
    wanted = through_window(light, x, y, 20.0, 6.0, 60.0, 1.5).reshape(24, 8, 24, 8).mean(axis=(1, 3))
    assert np.linalg.norm(found - wanted) < 0.01 * np.linalg.norm(wanted)
    assert found.sum() == pytest.approx(wanted.sum(), rel=1e-3)
    assert fates.total == pytest.approx(system.problem.source.flux, rel=1e-12)


@pytest.mark.parametrize("profile", ["uniform", "round"])
def test_a_lambertian_file_lights_as_a_lambertian_area(tmp_path, profile):
    size = {"source.half_width": [3.0, 1.0], "source.profile": profile, "source.flux": 2.0}
    write_ies(lambertian(), tmp_path / "lamp.ies")
    ours = lit(tmp_path, **size, **NEAR)
    theirs = lit(tmp_path, **size, **NEAR, **{"source.kind": "lambertian", "source.file": ""})
    a, b = (sequential(s, load_backend("double"), 512) for s in (ours, theirs))
    assert a[1].on_target == pytest.approx(b[1].on_target, rel=3e-3)
    assert np.linalg.norm(a[0] - b[0]) < 0.04 * np.linalg.norm(b[0])  # 400 rays per pixel


@pytest.mark.parametrize(
    "more",
    [{}, {"source.turn": [0.0, 180.0, 0.0]}, {"source.profile": "round", "source.half_width": [2.0, 1.0]}],
    ids=["as it is", "turned away", "round"],
)
def test_fates_sum_to_the_flux(lamp, more):
    """Light of gamma beyond 90 degrees, which goes back, passes beside the lens."""
    system = lit(lamp, **{"source.flux": 3.0, "target.pixels": [12, 12]} | more)
    path, screen = system.path, system.target.screen()
    _, fates = ray_irradiance(system, path, screen, load_backend("double"))
    assert fates.total == pytest.approx(3.0, rel=1e-12)
    light = system.source.directions.light
    below = light.flux_within(90.0) / light.flux
    back = below if "source.turn" in more else 1 - below
    assert fates.by_name["beside_lens"] > 3.0 * back


@pytest.mark.slow
def test_turning_by_half_a_turn_about_z_turns_the_picture(lamp):
    a, b = (
        sequential(s, load_backend("double"), 512)[0]
        for s in (lit(lamp, **COARSE), lit(lamp, **COARSE, **{"source.turn": [0.0, 0.0, 180.0]}))
    )
    np.testing.assert_allclose(b[::-1, ::-1], a, rtol=1e-9)
    assert np.linalg.norm(a - b) > 0.1 * np.linalg.norm(a)


def test_the_gradient_through_a_luminaire_is_that_of_differences(lamp):
    """In a quintic window, four times differentiable, so that fourth-order differences have their order."""
    system = lit(lamp, **{"source.flux": 1.0, "optimizer.window_degree": 5})
    space = system.space()
    model, c = system.model(space, (65, 65), "bspline"), rough(space, 0.03, 0)
    d, h = rough(space, 0.03, 1), 1e-4
    steps = [model.loss(c + k * h * d)[0] for k in (-2, -1, 1, 2)]
    difference = (8 * (steps[2] - steps[1]) - (steps[3] - steps[0])) / (12 * h)
    assert model.loss(c)[1] @ d == pytest.approx(difference, rel=1e-8)


def test_rays_of_a_symmetric_luminaire_are_taken_with_their_mirror_images(tmp_path):
    write_ies(lambertian(), tmp_path / "lamp.ies")
    size = {"source.half_width": [2.0, 1.0]}
    source = lit(tmp_path, **size).source
    assert source.symmetric
    rays, half = source.rays((16, 16)), mirror_half(source.rays((16, 16)), (0,))
    mirror = np.array([[-1.0], [1.0], [1.0]])
    for name in ("origin", "direction"):
        whole, part = getattr(rays, name), getattr(half, name)
        both = np.concatenate([part, mirror * part], axis=1)
        np.testing.assert_array_equal(np.sort(both, axis=1), np.sort(whole, axis=1))
    for more in ({"source.turn": [0.0, 0.0, 10.0]}, {"source.shift": [0.0, 1.0]}):
        assert not lit(tmp_path, **size | more).source.symmetric


@pytest.mark.parametrize(("c", "symmetric"), [(0.0, False), (90.0, False), (None, True)])
def test_a_lamp_that_leans_to_one_side_is_not_symmetric(c, symmetric):
    planes = np.arange(0, 361, 15.0)
    lean = 0.0 if c is None else np.cos(np.radians(planes - c))
    wings = np.cos(np.radians(2 * planes))
    candela = (2 + lean + 0.5 * wings)[:, None] * np.array([1.0, 2.0, 0.0])
    assert Luminaire(planes, [0.0, 45.0, 90.0], candela).symmetric == symmetric


def test_a_point_stands_for_the_luminaire_before_there_is_a_lens(lamp):
    point = lit(lamp).source.without_extent()
    assert isinstance(point, PointSource)
    assert point.distance == pytest.approx(20.0, abs=0.1)


def test_no_bound_is_given_and_a_sentence_says_what_is_assumed(lamp):
    from optics.designing.etendue import etendue_notes
    from optics.scene.system import advice

    system = lit(lamp)
    assert system.source.etendue == 0
    assert etendue_notes(system) == ([], [])
    assumed = "same intensity from every point"
    assert [assumed in sentence for sentence in advice(system)[:2]] == [True, False]
    own = system.problem.source.flux
    scaled = advice(lit(lamp, **{"source.flux": 2.0}))
    assert f"the flux of source.file, {own:.6g}, is scaled to source.flux = 2; 0 keeps it" in scaled
    dimmed = advice(lit(lamp, **{"source.flux": 2.0, "source.weight": 0.5}))
    assert f"the flux of source.file, {own:.6g}, is scaled to source.flux = 2; 0 keeps it" in dimmed
    assert "scaled" not in "".join(advice(lit(lamp, **{"source.weight": 0.5})))
    assert "scaled" not in "".join(advice(system))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"source.distance": 0.0}, "source touches the lens"),
        ({"source.distance": 0.5, "source.turn": [0.0, 45.0, 0.0]}, "behind the front"),
        ({"source.flux": -1.0}, "source.flux must be at least 1e-12"),
        ({"source.flux": 1e-13}, "source.flux must be at least 1e-12"),
        ({"source.profile": "gaussian"}, 'must be "uniform" or "round"'),
        ({"source.divergence": 1.0}, 'divergence has no effect with source.kind = "luminaire"'),
    ],
)
def test_what_does_not_go_together_is_one_sentence(lamp, more, words):
    with pytest.raises(optics.UserError, match=words):
        lit(lamp, **more)


def test_a_luminaire_that_lights_nothing_in_front_is_refused(tmp_path):
    dark = Luminaire([0.0, 360.0], [0.0, 80.0, 90.0], [[1.0, 1.0, 0.0]] * 2)
    write_ies(dark, tmp_path / "lamp.ies")
    with pytest.raises(optics.UserError, match=r"turn it with source\.tilt"):
        lit(tmp_path, **{"source.turn": [180.0, 0.0, 0.0]})
