"""The light of a perturbed lens, beside stops too: traced exactly, in whatever frame one thinks of it."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from optics.base.runtime import load_backend
from optics.light.analysis import cell_irradiance
from optics.scene.materials import MATERIALS
from optics.scene.problem import Problem
from optics.scene.sources import RayFileSource, Rays, single_rays
from optics.scene.system import Own, solvable_system
from optics.tolerancing.perturbations import NOMINAL, Perturbation, PerturbedLight
from optics.tolerancing.perturbations.perturbed_parts import PerturbedParts, perturbed_lens
from tests.cases import examples
from tests.optics.cases import TARGET_Z, alone
from tests.optics.tolerancing.perturbations.cases import (
    Bowl,
    Waves,
    rough_system,
    small_light,
    traced_by_numpy,
)

POINT = {"source.kind": "point", "source.distance": 25.0, "source.half_angle": 14.0}
SOURCE_Z = -2.0  # of the small problem
EVERYTHING = Perturbation(
    lens_shift=(0.3, -0.2, 0.4),
    lens_tilt=(0.02, -0.03, 0.05),
    front_shift=(0.2, 0.1, -0.05),
    front_tilt=(-0.01, 0.02, 0.03),
    source_shift=(-0.1, 0.2, 0.3),
    source_tilt=(0.01, 0.02, -0.03),
    target_shift=(1.0, 2.0, -3.0),
    target_tilt=(0.1, -0.2, 0.3),
    thickness=0.1,
    index=0.01,
    rear_power=0.02,
    front_error=Waves(2e-3),
    rear_error=Waves(1e-3, 1.3),
)


@pytest.fixture(scope="module")
def rough(tmp_path_factory):
    return rough_system(tmp_path_factory.mktemp("small"))


@pytest.fixture(scope="module")
def light(rough, backend):
    return PerturbedLight(rough, backend)


def relative(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(b)


def test_no_perturbation_leaves_the_light_of_the_same_cells(light, backend):
    load_backend("double", 1)  # several threads, which other tests may have asked for, add in any order
    irradiance, fates = light(NOMINAL)
    cells, screen = light.system.source.cells((144, 144)), light.screen
    expected, own = cell_irradiance(light.system.path, screen, cells, backend)
    np.testing.assert_array_equal(irradiance, expected)
    assert fates == own


def test_no_perturbation_leaves_every_part_itself(light):
    parts = PerturbedParts.of(light.system, NOMINAL)
    path = light.system.path
    assert [s.shape for s in parts.path.surfaces] == [light.system.designed.front, light.system.designed.rear]
    assert parts.path.receiver.pose.shift.tolist() == path.receiver.pose.shift.tolist()
    assert parts.source.is_identity
    assert perturbed_lens(light.system.designed, NOMINAL, None) is light.system.designed


def test_rays_land_where_numpy_has_them_in_the_frame_of_the_world(light, backend):
    p = EVERYTHING
    parts = PerturbedParts.of(light.system, p)
    rays = single_rays(light.system.source.rays((4, 5)), light.system.designed)
    _, landing = light.trace_through(parts)(parts.rays(rays))
    made = perturbed_lens(light.system.designed, p, None)
    expected = [
        traced_by_numpy(made, p, o, d, TARGET_Z, SOURCE_Z) for o, d in zip(rays.origin.T, rays.direction.T)
    ]
    # the search ends within 1e-10 of the coordinates; heights of the third order in 2e-3 are left
    assert np.allclose(np.column_stack([landing.x.numpy(), landing.y.numpy()]), expected, atol=2e-7, rtol=0)


def test_a_front_of_waves_alone_keeps_what_is_exact(light, backend):
    p = Perturbation(rear_error=Waves(5e-3, 2.0))  # light parallel to z meets it without a search
    parts = PerturbedParts.of(light.system, p)
    grid = light.system.source.rays((4, 5))
    _, landing = light.trace_through(parts)(grid)
    rays = single_rays(grid, light.system.designed)
    expected = [
        traced_by_numpy(light.system.designed, p, o, d, TARGET_Z, SOURCE_Z)
        for o, d in zip(rays.origin.T, rays.direction.T)
    ]
    assert np.allclose(np.column_stack([landing.x.numpy(), landing.y.numpy()]), expected, atol=1e-10, rtol=0)


def test_a_bowl_on_a_paraboloid_is_another_power(light):
    power = 0.01
    bowl = Bowl(power / light.system.designed.rear.conic.radius)  # r^2 / 2 R is the paraboloid itself
    tilted = Perturbation(lens_tilt=(0.01, 0.02, 0.0))  # so that the rear is searched for
    for p in (NOMINAL, tilted):
        by_height, _ = light(p + Perturbation(rear_error=bowl))
        by_power, _ = light(p + Perturbation(rear_power=power))
        assert relative(by_height, by_power) < 1e-8


def test_a_shift_of_the_lens_is_that_of_source_and_target_turned_round(light):
    shift, back = (0.3, -0.2, 0.0), (-0.3, 0.2, 0.0)
    of_lens, fates = light(Perturbation(lens_shift=shift))
    of_others, others = light(Perturbation(source_shift=back, target_shift=back))
    assert relative(of_lens, of_others) < 1e-12
    assert fates.on_target == pytest.approx(others.on_target, rel=1e-12)
    assert relative(of_lens, light(NOMINAL)[0]) > 0.01


def moved_together(tilt, shift):
    """Return the perturbation in which lens, source and target move as one rigid body."""
    turn = Rotation.from_rotvec(tilt)

    def of_pivot(z):
        pivot = np.array([0, 0, z])
        return tuple((turn.apply(pivot) - pivot + shift).tolist())

    return Perturbation(
        lens_shift=tuple(shift),
        lens_tilt=tuple(tilt),
        source_shift=of_pivot(SOURCE_Z),
        source_tilt=tuple(tilt),
        target_shift=of_pivot(TARGET_Z),
        target_tilt=tuple(tilt),
    )


def test_a_wedge_bends_light_as_a_prism(tmp_path, backend):
    """Of light along z through a plane tilted by a, and a plane: sin(out) = n sin(a - asin(sin a / n))."""
    plate = {"lens.rear.radius": float("inf"), "lens.rear.conic": 0.0}
    light = small_light(tmp_path, backend, plate, height=0.0)
    angle, n = 0.02, light.system.designed.index
    out = np.arcsin(n * np.sin(angle - np.arcsin(np.sin(angle) / n)))
    p = Perturbation(front_tilt=(0.0, angle, 0.0))
    parts = PerturbedParts.of(light.system, p)
    rays = single_rays(light.system.source.rays((4, 5)), light.system.designed)
    _, landing = light.trace_through(parts)(parts.rays(rays))
    assert np.abs(landing.p.numpy()) == pytest.approx(np.sin(out), rel=1e-9)
    assert np.abs(landing.q.numpy()).max() < 1e-12


ROUGH = {"lens.rear.slope_rms": 1e-3}


@pytest.fixture(scope="module", params=[{}, ROUGH], ids=["cells", "rays"])
def wide_light(request, tmp_path_factory, backend):
    """Even light that reaches 40 % and 30 % beyond the lens."""
    folder = tmp_path_factory.mktemp("wide")
    return small_light(folder, backend, {"source.half_width": [14.0, 13.0]} | request.param)


@pytest.fixture(scope="module")
def wide_nominal(wide_light):
    return wide_light(NOMINAL)


@pytest.fixture(scope="module")
def nominal(light):
    return light(NOMINAL)


@pytest.mark.slow
@examples(20)
@given(st.tuples(st.floats(-1.8, 1.8), st.floats(-1.8, 1.8)), st.floats(-0.05, 0.25))
def test_a_wider_beam_that_still_covers_the_lens_gives_it_the_same_light(
    wide_light, wide_nominal, shift, size
):
    """All of it is brighter or darker by the size of the beam.  What meets the lens is traced as before."""
    brighter = (1 + size) ** -2
    irradiance, fates = wide_light(Perturbation(source_shift=(*shift, 0.0), source_size=size))
    expected, others = wide_nominal
    assert relative(irradiance / brighter, expected) < 1e-9
    assert fates.on_target == pytest.approx(brighter * others.on_target, rel=1e-9)
    assert fates.total == pytest.approx(1.0, rel=1e-9)


@pytest.mark.slow
@examples(20)
@given(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), st.floats(-0.5, 0.5))
def test_as_much_of_a_moved_beam_misses_the_lens_as_lies_beside_it(wide_light, shift, size):
    """What two rectangles share; of rays, give or take a row of them at a border."""
    _, fates = wide_light(Perturbation(source_shift=(*shift, 0.0), source_size=size))
    half = (1 + size) * np.array([14.0, 13.0])
    shared = np.minimum(np.add(shift, half), 10) - np.maximum(np.subtract(shift, half), -10)
    fraction = np.prod(np.maximum(shared, 0) / (2 * half))
    rays = 0.0 if wide_light.by_cells else 0.02
    assert fates.by_name["beside_lens"] == pytest.approx(1 - fraction, abs=1e-6 + rays)


numbers = st.lists(st.floats(-1, 1), min_size=3, max_size=3)


@given(numbers, numbers)
def test_nothing_changes_where_everything_moves_together(light, nominal, tilt, shift):
    irradiance, _ = light(moved_together(0.3 * np.array(tilt), 5 * np.array(shift)))
    # meeting points are found within 1e-10 of the coordinates, some hundred mm
    assert relative(irradiance, nominal[0]) < 1e-6


WIDER = {"source.half_width": [14.0, 14.0], "lens.rear.half_width": [11.0, 11.0]}


@pytest.mark.every(2)
@pytest.mark.parametrize("changes", [{}, pytest.param(WIDER, marks=pytest.mark.slow), POINT])
@pytest.mark.parametrize("p", [EVERYTHING, Perturbation(lens_shift=(0.4, 0.0, 0.0), source_size=0.02)])
def test_the_fates_sum_to_the_flux(tmp_path, backend, changes, p):
    light = small_light(tmp_path, backend, changes)
    irradiance, fates = light(p)
    assert fates.total == pytest.approx(1.0, abs=1e-12)
    assert irradiance.sum() * light.screen.pixel_area == pytest.approx(fates.on_target, rel=1e-9)


@pytest.mark.slow
def test_a_beam_wider_than_the_lens_lights_it_wherever_it_stands(tmp_path, backend):
    light = small_light(tmp_path, backend, WIDER)
    _, fates = light(Perturbation(lens_shift=(0.3, 0.2, 0.0)))
    # the front cuts the same square of 20 mm out of a uniform beam of 28 mm
    assert fates.by_name["beside_lens"] == pytest.approx(1 - (20 / 28) ** 2, abs=1e-6)


def test_warm_plastic_is_larger_and_thinner_for_light(tmp_path, backend):
    system = rough_system(tmp_path, {"lens.material": "PMMA", "lens.index": "auto"})
    lens = system.designed
    warm = perturbed_lens(lens, Perturbation(temperature=30.0), system.material)
    s = 1 + 30 * 6e-5  # the expansion and dn/dT of PMMA by the data sheet of OKP4
    x, y = np.random.default_rng(1).uniform(-9, 9, (2, 50))
    assert warm.index == pytest.approx(lens.index - 30 * 1e-4, abs=1e-15)
    assert warm.thickness == pytest.approx(s * lens.thickness)
    assert np.allclose(warm.rear(s * x, s * y), s * lens.rear(x, y), atol=1e-13)
    light = PerturbedLight(system, backend)
    assert light.moved_by(Perturbation(temperature=30.0)) > 1e-3


def test_light_of_a_spectrum_is_that_of_its_wavelengths_one_by_one(tmp_path, backend):
    """The errors of the index, of the temperature too, come to the index of each."""
    glass = {"lens.material": "N-BK7", "lens.index": "auto", "lens.absorption": "auto"}
    system = rough_system(tmp_path, glass | {"source.spectrum": [[450.0, 1.0], [650.0, 3.0]]})
    p = Perturbation(index=0.003, temperature=400.0, lens_shift=(0.1, 0.0, 0.0))
    found, fates = PerturbedLight(system, backend)(p)
    image, absorbed = 0.0, 0.0
    for wavelength in system.wavelengths:
        one = alone(system, wavelength)
        light, own = PerturbedLight(one.with_sags(system.sags), backend)(p)
        image = image + wavelength.weight * light
        absorbed += wavelength.weight * own.by_name["absorbed"]
    np.testing.assert_allclose(found, image, rtol=1e-12, atol=1e-15)
    assert fates.by_name["absorbed"] == pytest.approx(absorbed, rel=1e-12)
    assert absorbed > 1e-4


def test_a_lens_of_another_index_than_its_material_stays_cold_at_all_wavelengths(tmp_path, backend):
    """Its table meets the catalogue at the lines, but not at the wavelength of the design."""
    table = [[nm, MATERIALS["PMMA"].index(nm)] for nm in (450.0, 650.0)]
    changes = {"lens.material": "PMMA", "lens.index": "auto", "lens.indices": table}
    system = rough_system(tmp_path, changes | {"source.spectrum": [[450.0, 1.0], [650.0, 3.0]]})
    assert system.material is None
    light = PerturbedLight(system, backend)
    np.testing.assert_array_equal(light(Perturbation(temperature=60.0))[0], light(NOMINAL)[0])


def test_perturbations_are_scaled_and_added_number_by_number():
    p = EVERYTHING * 2 + Perturbation(index=1.0, front_error=Bowl(1.0))
    x, y = np.array([0.3, 1.0]), np.array([-2.0, 0.5])
    assert p.lens_shift == (0.6, -0.4, 0.8)
    assert p.index == pytest.approx(1.02)
    assert np.allclose(p.front_error.jet(x, y), 2 * Waves(2e-3).jet(x, y) + Bowl(1.0).jet(x, y))
    assert NOMINAL * 3 == NOMINAL + NOMINAL == NOMINAL


BORDER_CELLS = 2000  # of the finest cells across the source


def test_a_stop_stands_still_when_the_lens_moves():
    """A flat lens moves nothing, wherever it is: the shadow stays to the last rays."""
    bar = {"shape": "rectangle", "half_width": (2.3, 4.1), "position": (0.7, -1.2, 30), "hole": False}
    size = {"half_width": (10, 10)}
    problem = Problem(
        source={"kind": "collimated", "half_width": (8, 8)},
        lens={"index": 1.5, "thickness": 6, "front": size, "rear": size},
        target={"kind": "tophat", "distance": 60, "half_width": (12, 12), "pixels": (16, 16)},
        stop=[bar],
    )
    scene = solvable_system(problem)
    moved = Perturbation(lens_shift=(0.4, -0.3, 1.0))
    traced = PerturbedLight(scene, scene.backend)
    (image, fates), (other, other_fates) = traced(), traced(moved)
    corner = (2 * 8 / BORDER_CELLS) ** 2  # mm^2, of the finest cells: chords cut it
    np.testing.assert_allclose(image, other, atol=image.max() * corner / 1.5**2)
    assert fates.blocked == pytest.approx(other_fates.blocked, abs=4 * corner / 16**2)


@pytest.mark.parametrize("shift", [(0.0, 0.05, 0.0), (-0.05, 0.0, 0.0), (0.0, 0.0, -0.05)], ids=str)
def test_a_front_that_moves_in_its_lens_does_not_stand_in_its_own_light(shift):
    """Light of an LED comes to a hollow front, which lay a twentieth of a millimetre before it."""
    problem = Problem(
        source={"kind": "lambertian", "half_width": (0.5, 0.5), "distance": 8, "flux": 1.0},
        lens={
            "index": 1.5,
            "thickness": 12,
            "front": {"half_width": (12, 12), "radius": -12, "conic": -1},
            "rear": {"half_width": (20, 20), "radius": -24, "conic": -1},
        },
        target={
            "kind": "tophat",
            "distance": 300,
            "tilt": (40, 0, 0),
            "half_width": (100, 100),
            "pixels": (16, 16),
        },
        stop=[{"shape": "rectangle", "half_width": (5, 5), "position": (0, 0, 60), "hole": False}],
    )
    scene = solvable_system(problem)
    traced = PerturbedLight(scene, scene.backend, per_pixel=64)
    (_, fates), (_, others) = traced(), traced(Perturbation(front_shift=shift))
    assert fates.blocked > 0.005
    assert others.blocked == pytest.approx(fates.blocked, abs=0.01)
    assert others.on_target == pytest.approx(fates.on_target, abs=0.01)


@pytest.mark.parametrize("error", [{"source_tilt": (0.01, 0.02, 0.0)}, {"source_size": 0.1}])
def test_a_source_turns_about_its_middle_however_its_place_is_told(tmp_path, backend, error):
    """By its distance, or by its position."""
    lamp = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.half_angle": 14.0}
    moves = []
    for place in ({"source.distance": 25.0}, {"source.position": [0.0, 0.0, -25.0]}):
        folder = tmp_path / next(iter(place))
        folder.mkdir()
        system = rough_system(folder, lamp | place)
        light = PerturbedLight(system, backend, 1)
        moves.append(light.moved_by(Perturbation(**error)))
    assert moves[0] > 0.0
    assert moves[1] == pytest.approx(moves[0], rel=1e-9)


def test_a_file_of_few_rays_is_as_noisy_as_it_is(tmp_path, backend):
    """Of 500 rays on 48 x 48 pixels: each pixel has less than one, whatever number is asked for."""
    system = rough_system(tmp_path)
    place = {"shift": (0.0, 0.0), "tilt": (0.0, 0.0, 0.0), "turn": (0.0, 0.0, 0.0)}
    file = RayFileSource(flux=1.0, distance=25.0, file="none", **place)
    x, y = np.random.default_rng(1).uniform(-8, 8, (2, 500))
    along = np.tile([[0.0], [0.0], [1.0]], 500)
    file.__dict__["placed"] = Rays(np.stack([x, y, np.full(500, -2.0)]), along, np.full(500, 1 / 500))
    light = PerturbedLight(system.with_prescription(own=Own(file)), backend)
    found, _ = light.estimate()
    lit = found.irradiance > 0
    assert (found.error[lit] >= 0.99 * found.irradiance[lit]).mean() > 0.5


def test_the_size_of_a_placed_source_is_that_of_its_own_frame():
    """A wider beam at the place of one on the axis is that one, made wider."""
    sides = {
        "front": {"half_width": (12, 12)},
        "rear": {"half_width": (12, 12), "freeform": {"spans": (4, 4)}},
    }
    spans = []
    for place in ({"distance": 30}, {"position": (0, 0, -30)}, {"position": (5, 0, -30)}):
        problem = Problem(
            source={"kind": "collimated", "half_width": (4, 4), **place},
            lens={"index": 1.5, "thickness": 6, **sides},
            target={"kind": "tophat", "distance": 60, "half_width": (30, 30), "pixels": (12, 12)},
        )
        system = solvable_system(problem)
        parts = PerturbedParts.of(system, Perturbation(source_size=0.1))
        rays = parts.cells(system.source.cells((4, 4))).rays()
        rays = rays if isinstance(rays, Rays) else rays.rays(-30.0)
        spans.append(np.array([rays.origin[0].min(), rays.origin[0].max()]))
    np.testing.assert_allclose(spans[1], spans[0], rtol=1e-12)
    np.testing.assert_allclose(spans[2], spans[0] + 5.0, rtol=1e-12)
