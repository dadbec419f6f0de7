"""The greatest concentration of light behind a lens, where it is known in closed form or by counting rays."""

from dataclasses import replace
from math import pi, radians, tan
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from optics.base.runtime import UserError, load_backend
from optics.light.outgoing import (
    Concentration,
    concentration,
    concentration_sentence,
    fire_warning,
    greatest_concentration,
)
from optics.light.outgoing.concentration import _gathered
from optics.light.outgoing.straight_light import StraightLight
from optics.scene.problem import Problem
from optics.scene.system import System
from tests.cases import THOROUGH, examples
from tests.optics.cases import roughened, small_system, tracer_to

FOCUS = 400.0  # mm, of the rear -R / (n - 1), K = -n^2, which images parallel light to a point
BURNING = {"lens.rear.radius": -200.0, "lens.rear.conic": -2.25, "target.distance": 480.0}
BEAM = 19.0**2  # mm^2
WINDOW = {"lens.rear.radius": np.inf, "lens.rear.conic": 0.0}


@pytest.fixture(autouse=True, scope="module")
def _fewer_cells():
    """A quarter of the cells in `make test`: their errors stay far below what is claimed here."""
    with pytest.MonkeyPatch.context() as patch:
        if not THOROUGH:
            patch.setattr("optics.light.outgoing.concentration.CELLS", 256)
        yield


@pytest.fixture(scope="module")
def concentrated(tmp_path_factory, backend):
    """A function that returns the system of the small problem with changes, and its base lens's light; of the
    same changes it is computed once."""
    folder, known = tmp_path_factory.mktemp("concentrated"), {}

    def found(changes):
        if (key := repr(changes)) not in known:
            system = small_system(folder, changes)
            known[key] = system, greatest_concentration(system, backend)
        return known[key]

    return found


def test_a_perfect_focus_puts_all_light_on_the_disk(concentrated):
    system, found = concentrated(BURNING)
    assert found.disk == 1.0
    assert found.behind == pytest.approx(FOCUS, abs=20)  # where the beam is narrower than the disk
    assert found.times == pytest.approx(BEAM / (pi / 4), rel=1e-3)
    assert found.irradiance == pytest.approx(system.problem.source.flux / (pi / 4), rel=1e-3)
    assert found.sunlight == found.times
    assert found.searched == 480


@pytest.mark.slow
def test_the_sun_s_own_disk_limits_a_focus(concentrated):
    """A square beam that shrinks towards the focus, in a disk that grows as the sun's image does."""
    system, found = concentrated(BURNING | {"source.divergence_profile": "sun"})
    angle = np.arcsin(np.sqrt(1 / (pi * system.source.spread.on_axis)))
    assert 0.8 * radians(0.2666) < angle < radians(0.2666)  # the limb is darker
    at = np.linspace(-1, 1, 801)
    radius = np.hypot(at, at[:, None])
    best = max(
        (radius * 9.5 * abs(1 - s / FOCUS) <= s * tan(angle)).mean() / (pi * (s * tan(angle)) ** 2)
        for s in np.linspace(360, 440, 201)
    )
    assert found.times == pytest.approx(BEAM * best, rel=0.02)
    assert found.disk == pytest.approx(2 * found.behind * tan(angle), rel=0.02)


def test_before_the_focus_light_is_as_dense_as_the_beam_is_narrow(concentrated):
    _, found = concentrated(BURNING | {"target.distance": FOCUS / 2})
    assert found.behind == pytest.approx(FOCUS / 2)
    assert found.times == pytest.approx(4, rel=0.02)  # tan u is not quite r / f


def test_a_window_concentrates_nothing(concentrated):
    _, found = concentrated(WINDOW)
    assert found.times == pytest.approx(1, abs=0.02)


def test_a_round_beam_is_as_dense_as_its_disk(concentrated):
    """Not as the square around it."""
    _, found = concentrated(WINDOW | {"source.profile": "round"})
    assert found.times == pytest.approx(1.0, abs=0.03)


def test_light_that_spreads_is_densest_at_the_rear(concentrated):
    _, found = concentrated({"lens.rear.radius": 200.0, "target.half_width": [40.0, 40.0]})
    assert found.behind < 1
    assert found.times == pytest.approx(1, abs=0.02)


def test_a_glowing_area_behind_a_window_gives_its_radiance_times_its_solid_angle(concentrated):
    """P = pi sin^2 of a disk, seen through 6 mm of n = 1.5: near the axis as from 4 mm less t - t / n."""
    glow = {
        "source.kind": "lambertian",
        "source.profile": "round",
        "source.half_width": [2.0, 2.0],
        "source.distance": 20.0,
    }
    system, found = concentrated(WINDOW | glow)
    radiance = system.problem.source.flux / (pi * pi * 2.0**2)
    expected = radiance * pi * 2**2 / (2**2 + (20 + 6 / 1.5) ** 2)
    assert found.irradiance == pytest.approx(expected, rel=0.15)  # the brightest disk of random rays
    assert found.irradiance > 0.97 * expected
    assert found.sunlight is None


def test_the_far_field_is_followed_ten_metres(concentrated):
    _, found = concentrated(BURNING | {"target.distance": np.inf, "target.half_width": [20.0, 20.0]})
    assert found.searched == 10_000
    assert found.times == pytest.approx(BEAM / (pi / 4), rel=1e-3)


@pytest.mark.slow
@examples(3)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.4))
def test_no_counted_disk_holds_more(tmp_path_factory, seed, height):
    """Rays of another grid through a rough lens: disks around many rays on planes at random."""
    rng, backend = np.random.default_rng(seed), load_backend("double", 1)
    system = small_system(tmp_path_factory.mktemp("rough"), {})
    lens = roughened(system.base, height, [seed % 1000])
    found = greatest_concentration(system.with_lens(lens), backend)
    rays = system.source.rays((701, 701))
    each = rays.total / rays.flux.size
    best = 0.0
    for behind in (found.behind, *rng.uniform(1.5, found.searched, 2)):
        tracer = tracer_to(backend, lens, rays, lens.thickness + behind, fresnel=False)
        with backend.dr.suspend_grad():
            _, landing = tracer.trace([lens.sags[-1].coefficients])
        points = np.stack([landing.x.numpy(), landing.y.numpy()], axis=1)[landing.flux.numpy() > 0]
        counts = cKDTree(points).query_ball_point(points[::40], found.disk / 2, return_length=True)
        counted = counts.max() * each / (pi / 4 * found.disk**2)
        best = max(best, counted)
        assert counted <= 1.05 * found.irradiance
    assert best >= 0.93 * found.irradiance  # the best disk is not about a ray


@given(bins=st.lists(st.integers(0, 200), min_size=1, max_size=20), gap=st.integers(0, 1000))
def test_bins_that_a_disk_joins_keep_their_distance_and_others_stay_apart(bins, gap):
    """A disk is seven bins wide."""
    at = np.array([*bins, *(b + 1000 * gap for b in bins)])
    close = _gathered(at)
    apart, kept = (abs(np.subtract.outer(b, b)) for b in (at, close))
    joined = apart <= 7
    np.testing.assert_array_equal(kept[joined], apart[joined])
    assert (kept[~joined] > 7).all()
    assert close.max() <= 8 * len(at)


def test_light_that_may_start_a_fire_is_warned_of(concentrated):
    system, found = concentrated(BURNING)
    assert fire_warning(system, found).startswith(
        "light that may start a fire: "
        "1.27e+03 kW/m^2 with the source and 460 kW/m^2 with sunlight of 1 kW/m^2, "
    )
    said = concentration_sentence(system, found)
    assert "460 times that of the beam, " in said
    assert "460 kW/m^2 in the sun" in said
    assert "mean over 1 mm, without losses; searched up to 480 mm" in said
    weak = replace(found, times=9.9, sunlight=9.9, irradiance=0.0099)
    assert fire_warning(system, weak) == ""
    assert "fire: 10.1 kW/m^2 with the source, " in fire_warning(system, replace(weak, irradiance=0.0101))


def test_lumens_tell_no_heat(concentrated):
    lamp = {"source.kind": "point", "source.distance": 30.0, "source.half_width": [0.0, 0.0]}
    system, found = concentrated(lamp | {"source.unit": "lm", "source.flux": 1e6})
    assert isinstance(found, Concentration)
    assert "lx" in concentration_sentence(system, found)
    assert fire_warning(system, found) == ""


def test_a_lens_that_no_light_leaves_has_no_concentration(concentrated):
    with pytest.raises(UserError, match="no light leaves the lens"):
        concentrated(WINDOW | {"lens.rear.half_width": [0.01, 0.01]})


@pytest.mark.every(3)
@pytest.mark.parametrize("tilt", [0.0, 45.0, 75.0])
def test_a_plane_mirror_concentrates_nothing_however_it_is_turned(backend, tilt):
    face = {"half_width": (10, 40), "freeform": {"z_freedom": 1.0}}
    mirror = {"kind": "mirror", "name": "M1", "tilt": (tilt, 0, 0), "thickness": 4, "face": face}
    turn = 180 + 2 * tilt  # from +z to where the light goes
    place = Rotation.from_euler("X", turn, degrees=True).apply([0.0, 0.0, 60.0])
    target = {"kind": "tophat", "position": tuple(place), "tilt": (turn, 0, 0)}
    problem = Problem(
        source={"kind": "collimated", "half_width": (8, 8), "distance": 100},
        element=[mirror],
        target=target | {"half_width": (10, 10), "pixels": (8, 8)},
    )
    system = System(problem)
    assert greatest_concentration(system, backend).times == pytest.approx(1.0, rel=2e-2)


LENS = {
    "kind": "lens",
    "name": "L1",
    "index": 1.5,
    "thickness": 6.0,
    "front": {"half_width": (10, 10)},
    "rear": {"half_width": (10, 10), "radius": -200.0, "conic": -2.25, "freeform": {"z_freedom": 1.0}},
}


def folded(first, second, half=15, rear=MappingProxyType({})):
    """Return the system of a lens with its focus, and of two plane mirrors at 45 degrees.

    first, second : mm from the rear to a mirror, and from that to the other one.  half : mm, of their faces.
    """
    plane = {"half_width": (half, half), "radius": np.inf, "conic": 0.0, "freeform": False}
    z = 6.0 + first
    places = ((0, 0, z), (45, 0, 0)), ((0, second, z), (225, 0, 0))  # +z goes on along +y, and that along +z
    mirrors = [
        {"kind": "mirror", "name": f"M{k}", "position": at, "tilt": tilt, "thickness": 4, "face": plane}
        for k, (at, tilt) in enumerate(places, 1)
    ]
    end = (0, second, z + 480 - first - second)
    return System(
        Problem(
            source={"kind": "collimated", "half_width": (9.5, 9.5), "distance": 20},
            element=[LENS | {"rear": LENS["rear"] | rear}, *mirrors],
            target={"kind": "tophat", "position": end, "half_width": (10, 10), "pixels": (8, 8)},
        )
    )


@pytest.mark.slow
@pytest.mark.parametrize(("at", "place"), [(440, "behind L1.rear"), (100, "behind L2.rear")])
def test_a_window_passes_a_focus_on(concentrated, backend, at, place):
    """It puts off what it lies before by t - t / n = 2 mm, and begins `at` mm behind the rear."""
    _, alone = concentrated(BURNING)
    plane = {"half_width": (10, 10), "radius": np.inf, "conic": 0.0, "freeform": False}
    window = {"kind": "lens", "name": "L2", "position": (0, 0, 6 + at), "index": 1.5, "thickness": 6.0}
    elements = [LENS, window | {"front": {"half_width": (10, 10)}, "rear": plane}]
    target = {"kind": "tophat", "position": (0, 0, 486), "half_width": (10, 10), "pixels": (8, 8)}
    source = {"kind": "collimated", "half_width": (9.5, 9.5), "distance": 20}
    system = System(Problem(source=source, element=elements, target=target))
    found = greatest_concentration(system, backend)
    assert found.times == pytest.approx(alone.times, rel=1e-3)
    assert found.behind == pytest.approx(FOCUS + (0 if "L1" in place else 2 - at - 6), abs=20)
    assert f" mm {place} vertex" in concentration_sentence(system, found)


@pytest.mark.every(5)
@pytest.mark.parametrize(
    ("ways", "place"),
    [
        ((440, 20), "behind L1.rear"),
        ((440, 20, 0.3), "behind L1.rear"),  # nine tenths of the light pass beside the mirror
        ((FOCUS, 40), "behind L1.rear"),  # on the first mirror itself
        ((100, 340), "before M1.face"),
        ((100, 100), "before M2.face"),
    ],
)
def test_plane_mirrors_fold_a_focus_and_its_warning_with_it(concentrated, backend, ways, place):
    _, alone = concentrated(BURNING)
    system = folded(*ways)
    found = greatest_concentration(system, backend)
    assert found.times == pytest.approx(alone.times, rel=1e-3)
    gone = {"L1": 0, "M1": ways[0], "M2": ways[0] + ways[1]}[place[7:9]]
    assert found.behind == pytest.approx(FOCUS - gone, abs=20)  # where the beam is narrower than the disk
    where = f"{round(found.behind, 2):g} mm {place} "
    assert f"{where}vertex (mean over 1 mm" in concentration_sentence(system, found)
    assert f"{where}(wood may burn" in fire_warning(system, found)


@pytest.mark.slow
def test_the_sentence_says_from_where_to_where_several_elements_were_searched(backend):
    system = folded(100, 100)
    found = greatest_concentration(system, backend)
    assert "searched up to 280 mm before M2.face, from L1.rear on)" in concentration_sentence(system, found)


@pytest.mark.slow
def test_light_that_meets_close_to_a_turned_mirror_is_found(concentrated, backend):
    """Rays of a sphere meet 2 mm from the mirror, which others leave 10 mm farther along the way."""
    _, alone = concentrated(BURNING | {"lens.rear.radius": -20.0, "lens.rear.conic": 0.0})
    system = folded(alone.behind - 2, 100, rear={"radius": -20.0, "conic": 0.0})
    found = greatest_concentration(system, backend)
    assert found.times == pytest.approx(alone.times, rel=0.02)
    assert found.behind == pytest.approx(2, abs=0.5)


def test_light_is_followed_to_a_target_however_far(concentrated):
    _, found = concentrated(BURNING | {"target.distance": 12_000.0})
    assert found.searched == pytest.approx(12_000.0)


def test_a_beam_that_is_placed_burns_as_one_on_the_axis(concentrated):
    """By tilt, which turns lens and target with it in nothing but words: a beam turned about its own axis."""
    placed = {"source.position": [0.0, 0.0, -20.0], "source.tilt": [0.0, 0.0, 90.0]}
    (_, plain), (system, there) = concentrated(BURNING), concentrated(BURNING | placed)
    assert there.sunlight == pytest.approx(plain.sunlight, rel=0.02)
    assert "times that of the beam" in concentration_sentence(system, there)


def test_light_however_wide_is_searched_on_as_few_places(monkeypatch):
    """Rays of slopes as those of an emitter near grazing, to 1e9, around a bundle within half a disk: its
    search of blocks in blocks did not end.  The disk holds all of the bundle, after a look at few places.
    """
    rng = np.random.default_rng(1)
    tangents = np.tan(np.arcsin(np.sqrt(rng.uniform(0, 1 - 1e-18, 20_000))))
    turns = rng.uniform(0, 2 * np.pi, 20_000)
    slope = np.stack([tangents * np.cos(turns), tangents * np.sin(turns)])
    bundle = 500.0 + rng.uniform(-0.1, 0.1, (2, 400))
    start = np.concatenate([rng.uniform(-5, 5, (2, 20_000)), bundle], axis=1)
    slope = np.concatenate([slope, np.zeros((2, 400))], axis=1)
    number = slope.shape[1]
    light = StraightLight(
        face=1,
        start=start[:, None, :],
        slope=slope[:, None, :],
        middle=(start, slope),
        flux=np.ones(number),
        begin=np.zeros(number),
        end=np.full(number, np.inf),
        z0=0.0,
        depth=0.0,
        nearest=0.0,
        farthest=1000.0,
        disk=1.0,
    )
    few, calls = concentration._most_of_few, list[int]()
    monkeypatch.setattr(concentration, "_most_of_few", lambda *a: calls.append(a[2].size) or few(*a))
    assert concentration._most_in_disk(light, 1000.0, 1.0, 4) == pytest.approx(400, rel=1e-12)
    assert len(calls) <= 4
    assert max(calls) < 500
