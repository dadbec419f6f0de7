"""Light by independent programs: right files agree, wrong ones do not, noise and mesh error are known."""

from dataclasses import replace

import numpy as np
import pytest

from optics.exchange.cross_checks import (
    compare_light,
    file_tracer,
    light_comparison as module,
    light_comparison_checks,
    light_comparison_lines,
)
from optics.exchange.cross_checks.light_comparison import LightComparison
from optics.exchange.cross_checks.light_sums import Distances
from optics.exchange.verification import StepFile
from optics.scene.receivers import Screen
from optics.scene.system import System
from tests.optics.cases import failing, small_system
from tests.optics.exchange.verification.cases import FAR, FREE_FRONT, LAMBERTIAN, POINT, shaped
from thbcad import write_step
from thbcad.lens import FreeformSurface, Lens, placed_surfaces
from thbcad.sags import Conic

RAYS = {"mitsuba": 100_000, "occt": 1000, "optiland": 1000}
NODES = 129


@pytest.fixture(autouse=True)
def one_thread(backend):
    """Mitsuba sets the number of threads."""
    yield
    backend.dr.set_thread_count(1)


def compared(folder, system, lens, written, tracer, backend, nodes=NODES):
    """Return the comparison of a tracer's light through the file of `written` with ours through `lens`."""
    if tracer != "occt":
        pytest.importorskip(tracer)
    path = folder / "lens.step"
    write_step(written, path, replace(system.product, index=written.index))
    return compare_light(
        system.with_lens(lens), file_tracer(tracer, StepFile(path), system, nodes), RAYS[tracer], backend
    )


def failed(found, system):
    names = failing(light_comparison_checks(found, system.problem.verify))
    return [name.rpartition(": ")[2] for name in names]


CASES = {
    "coated, occt": ({"lens.front.reflectance": 0.3}, "occt"),
    "beam, mitsuba": ({}, "mitsuba"),
    "beam, optiland": ({}, "optiland"),
    "area, occt": (LAMBERTIAN, "occt"),
    "point, mitsuba": (POINT, "mitsuba"),
    "point, optiland": (POINT, "optiland"),
    "area, two free surfaces, far field, mitsuba": (LAMBERTIAN | FREE_FRONT | FAR, "mitsuba"),
}
QUICK = list(CASES)[:3]
EVERY_CASE = [
    pytest.param(*case, id=name, marks=[] if name in QUICK else [pytest.mark.slow])
    for name, case in CASES.items()
]


@pytest.mark.every(3)
@pytest.mark.parametrize(("changes", "tracer"), EVERY_CASE)
def test_the_light_of_a_good_file_agrees(tmp_path, backend, changes, tracer):
    problem, lens = shaped(tmp_path, changes)
    system = System(problem)
    found = compared(tmp_path, system, lens, lens, tracer, backend)
    assert failed(found, system) == []
    assert abs(found.z) < 4
    # whole numbers of columns and rows are rounded down
    assert 400 <= found.rays_per_pixel <= 900 or found.theirs.size == 1
    if tracer != "mitsuba":
        assert found.mesh_landing == found.mesh_difference == 0
        assert found.difference_of_same_rays < 1e-12
    assert len(light_comparison_lines(found)) == (4 if tracer == "mitsuba" else 3)
    assert ("other rays" in light_comparison_lines(found)[-1]) == system.source.extended


def wrong_files(lens):
    rear = FreeformSurface(lens.rear.half_width, Conic(40.4, -1.0), lens.rear.sag)
    turned = [FreeformSurface((10.0, 10.0), conic) for conic in (Conic(-40.0, -1.0), Conic())]
    return {
        "radius": replace(lens, rear=rear),
        "index": replace(lens, index=1.51),
        "turned": Lens(*turned, lens.thickness, lens.index),
    }


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("tracer", "wrong"),
    [
        ("mitsuba", "radius"),
        ("mitsuba", "index"),
        ("mitsuba", "turned"),
        ("occt", "radius"),
        ("occt", "turned"),
        ("optiland", "index"),
        ("optiland", "turned"),
    ],
)
def test_a_wrong_file_is_noticed(tmp_path, backend, tracer, wrong):
    """A plano-paraboloid with a radius or an index that is 1 % off, or turned around."""
    system = small_system(tmp_path)
    found = compared(tmp_path, system, system.base, wrong_files(system.base)[wrong], tracer, backend)
    assert {"landing points, root mean square", "irradiance, relative"} <= set(failed(found, system))
    assert ("flux with another fate, relative" in failed(found, system)) == (wrong == "turned")


@pytest.mark.slow
def test_other_light_is_noticed_by_counting_alone(tmp_path, backend, monkeypatch):
    """The z-score compares with cells, and knows nothing of the same rays."""
    system = small_system(tmp_path)
    monkeypatch.setitem(RAYS, "mitsuba", 300_000)
    found = compared(tmp_path, system, system.base, wrong_files(system.base)["turned"], "mitsuba", backend)
    assert found.z > 20
    assert found.difference > 1.5 * found.noise


@pytest.mark.slow
def test_the_error_of_the_mesh_falls_with_the_square_of_the_spacing_and_is_known(tmp_path, backend):
    """sqrt(10) / 3 separates the estimate from the error of linear interpolation; a spline's second
    derivatives vary within its spans."""
    problem, lens = shaped(tmp_path)
    system = System(problem)
    spans = [len(kv.breaks) - 1 for kv in (placed_surfaces(lens)[1].kv_u, placed_surfaces(lens)[1].kv_v)]
    counts = [1 + each * max(spans) for each in (4, 8, 16)]
    found = [compared(tmp_path, system, lens, lens, "mitsuba", backend, n) for n in counts]
    true, estimated = ([getattr(f, k) for f in found] for k in ("to_ours", "mesh_landing"))
    errors = np.array([t.rms for t in true])
    np.testing.assert_allclose(errors[:-1] / errors[1:], 4, rtol=0.1)
    np.testing.assert_allclose(estimated / errors, np.sqrt(10) / 3, rtol=0.15)


def image_comparison(theirs, ours, variance, error=None):
    screen = Screen((1.0, 1.0), theirs.shape[::-1])
    return LightComparison(
        name="simulated",
        screen=screen,
        theirs=theirs,
        same_rays=theirs,
        coarser=None,
        ours=ours,
        ours_error=error,
        variance=variance,
        to_ours=Distances(),
        to_coarser=None,
        resolution=None,
        rays=1,
        emitted=1.0,
        seconds=0.0,
    )


@pytest.mark.parametrize("sets", [0, 2], ids=["cells", "two sets of rays"])
def test_the_z_score_of_counts_is_standard(sets):
    """400 pictures of 24 x 24 counts with dark pixels: mean 0 to 4 / sqrt(400), deviation 1 to 15 %."""
    rng = np.random.default_rng(0)
    light = 400 * rng.random((24, 24)) ** 3
    scores = []
    for _ in range(400):
        counts = rng.poisson(light).astype(float)
        if sets:
            one, other = (rng.poisson(4 * light) / 4 for _ in range(2))
            found = image_comparison(counts, (one + other) / 2, counts, (one - other) / 2)
        else:
            found = image_comparison(counts, light, counts)
        scores.append(found.z)
    assert abs(np.mean(scores)) < 0.2
    assert np.std(scores) == pytest.approx(1, rel=0.15)


def test_the_z_score_grows_with_a_difference():
    light = np.full((24, 24), 400.0)
    counts = np.random.default_rng(0).poisson(1.05 * light).astype(float)  # off by as much as the noise
    found = image_comparison(counts, light, counts)
    # the mean of d^2 is that of its variance twice over: 24 / sqrt(2) standard deviations of the sum
    assert found.z == pytest.approx(24 / np.sqrt(2), abs=5)


def test_pixels_are_merged_until_the_rays_suffice(tmp_path):
    system = small_system(tmp_path, {"target.pixels": [48, 24]})
    assert module.merged(system, 400 * 12 * 6).pixels == (12, 6)
    assert module.merged(system, 1e9).pixels == (48, 24)
    assert module.merged(system, 0).pixels == (1, 1)
