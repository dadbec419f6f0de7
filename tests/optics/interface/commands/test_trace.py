"""`thbcad trace`: fates by flux and by number, other ways of light, files, refusals."""

import json
import re

import numpy as np
import pytest

from optics.exchange.results import ResultFolder
from optics.light.analysis import measure, sequential
from optics.scene.problem import Problem
from optics.scene.system import System
from tests.optics.cases import FREE_REAR, store_result, write_problem
from tests.optics.interface.commands.cases import refused, run
from thbcad import Lens, write_step
from thbcad.io import write_lens
from thbcad.lens import FreeformSurface
from thbcad.sags import Conic

EXTENDED = {
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "source.distance": 2.0,
    "optimizer.window": "bspline",
}


@pytest.mark.slow
def test_every_ray_and_every_watt_has_a_fate(capsys, stored):
    folder = stored(EXTENDED)
    done = run(capsys, "trace", folder, "--rays", 64, "--json")
    data = json.loads(done.out)
    assert done.code == 0
    assert sum(data["counts"].values()) == data["rays"] == 64 * 64
    assert sum(data["fates_w"].values()) == pytest.approx(1.0, abs=1e-12)
    assert sum(data["nonsequential"]["fates_w"].values()) == pytest.approx(1.0, abs=1e-12)
    assert data["counts"]["unresolved"] == 0
    assert data["counts"]["missed_rear"] > 0
    assert data["efficiency"] == data["fates_w"]["on_target"]
    assert data["efficiency"] < data["normal_incidence_transmittance"] == pytest.approx(0.96**2)
    assert 0 < data["nonsequential"]["by_other_ways"] < 1
    light = {"irradiance.npz", "irradiance_16bit.png"}
    files = {"fresnel.png", "irradiance.png", "phase_space.png", "trace.json"} | light
    assert {p.name for p in (folder / "trace").iterdir()} == files
    with np.load(folder / "trace" / "irradiance.npz", allow_pickle=False) as arrays:
        pixel = np.diff(arrays["x"])[0] * -np.diff(arrays["y"])[0]
        assert arrays["irradiance"].sum() * pixel == pytest.approx(data["fates_w"]["on_target"], rel=1e-12)


PLATE = {"lens.array.columns": 2, "lens.array.rows": 1, "lens.array.pitch": 25.0, "lens.thickness": 8.0}
LAMP = {"source.kind": "lambertian", "source.half_width": [0.5, 0.5]}
COLOURS = {"lens.material": "PC", "lens.index": "auto", "source.spectrum": [[450, 1], [650, 1]]}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "words", "phases"),
    [
        (COLOURS, "light by other ways, etendue and phase space are those of 550 nm alone", True),
        (LAMP | {"source.position": [1.0, 0.0, -25.0]}, "it is shown of one source on the axis", False),
    ],
    ids=["colours", "placed"],
)
def test_what_is_not_shown_is_said(capsys, stored, changes, words, phases):
    folder = stored(changes)
    done = run(capsys, "trace", folder, "--rays", 16)
    assert words in done.out
    assert (folder / "trace" / "phase_space.png").exists() is phases


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "images"),
    [(PLATE | LAMP, 2), (LAMP | COLOURS, 2), (LAMP | {"lens.rear.slope_rms": 0.05}, 1)],
    ids=["plate", "colours", "rough"],
)
def test_trace_shows_the_light_that_is_measured(capsys, stored, changes, images):
    """Of every lens of a plate, at every wavelength, spread by rough faces: fates and picture as measured."""
    folder = stored(changes)
    system = ResultFolder(folder).read().system
    measured = measure(system, system.backend)
    data = json.loads(run(capsys, "trace", folder, "--rays", 256, "--json").out)
    assert data["rays"] == images * 256**2
    for name, flux in measured.metrics["fates_w"].items():
        assert data["fates_w"][name] == pytest.approx(flux, abs=2e-3 * system.with_all_sources.problem.flux)
    with np.load(folder / "trace" / "irradiance.npz", allow_pickle=False) as arrays:
        blocks, known = (_blocks(light) for light in (arrays["irradiance"], measured.irradiance))
    assert np.abs(blocks - known).max() < 0.1 * known.max()  # light by other ways is measured too


def _blocks(light):
    """Means over a fourth of the picture's width and height each, in which the noise of rays is small."""
    rows, columns = light.shape
    return light.reshape(4, rows // 4, 4, columns // 4).mean((1, 3))


def test_a_mirror_is_traced_along_its_path_and_named_as_one(capsys, tmp_path):
    """A beam within a plane mirror at 45 degrees: all that is reflected lands, the rest is absorbed."""
    face = {"half_width": (10, 15)}
    mirror = {"kind": "mirror", "name": "M1", "tilt": (45, 0, 0), "thickness": 4, "face": face}
    target = {"kind": "tophat", "position": (0, 60, 0), "tilt": (-90, 0, 0), "half_width": (10, 10)}
    beam = {"kind": "collimated", "half_width": (8, 8)}
    problem = Problem(
        source=beam, element=[mirror | {"reflectance": 0.8}], target=target | {"pixels": (8, 8)}
    )
    folder = store_result(tmp_path / "result", problem, System(problem).base).path
    done = run(capsys, "trace", folder, "--rays", 16)
    assert done.code == 0
    assert "0.800000 W        256 rays  meets the target" in done.out
    assert "0.200000 W                  is absorbed at M1.face, or on its way there" in done.out
    assert "efficiency 0.8000; the mirror reflects 80.0%" in done.out
    assert "lens on the axis" in done.out  # why there is no picture of phase space
    assert not re.search("front|rear|edge", done.out)
    light = {"irradiance.npz", "irradiance_16bit.png", "irradiance.png"}
    assert {p.name for p in (folder / "trace").iterdir()} == {*light, "trace.json"}
    said = refused(capsys, "export", folder, "--out", tmp_path / "mirror.ies")
    assert "this is element.M1; export its rays by --light rear" in said


def test_rays_are_counted_as_the_flux_is(backend, stored):
    """Without Fresnel's losses flux and number agree: every ray carries the same."""
    system = ResultFolder(stored(EXTENDED | {"lens.index": 1.0 + 1e-9})).read().system
    _, budget, counts = sequential(system, backend, 64)
    for name, count in counts.items():
        assert count / 4096 == pytest.approx(budget.by_name[name], abs=1e-6), name


@pytest.mark.slow
def test_a_collimated_beam_needs_no_other_tracer(capsys, stored, tmp_path):
    done = run(
        capsys, "trace", stored(), "--rays", 33, "--out", tmp_path / "deep" / "there", "--precision", "single"
    )
    assert done.code == 0
    assert "the sequential tracer suffices" in done.out
    assert "etendue is conserved" in done.out
    assert (tmp_path / "deep" / "there" / "trace.json").exists()


@pytest.mark.slow
def test_a_far_field_is_traced_by_all_ways_too(capsys, stored):
    folder = stored({"target.distance": float("inf"), "target.half_width": [30.0, 30.0]})
    done = run(capsys, "trace", folder, "--rays", 33, "--json")
    found = json.loads(done.out)
    assert (done.code, found["nonsequential"]["fates_w"]["failed"]) == (0, 0.0)
    assert found["nonsequential"]["fates_w"]["on_target"] == pytest.approx(
        found["fates_w"]["on_target"], rel=0.1
    )


@pytest.mark.parametrize("rays", ["7", "100000"])
def test_a_number_of_rays_out_of_range_is_refused(capsys, stored, rays):
    said = refused(capsys, "trace", stored(), "--rays", rays)
    assert "--rays must lie between 8 and 32768" in said


@pytest.fixture(scope="module")
def strange_lens(tmp_path_factory):
    """The STEP file of a plano-convex lens, 4 mm thick, as another program may have written it."""
    rear = FreeformSurface((10.0, 10.0), Conic(-40.0, 0.0))
    path = tmp_path_factory.mktemp("theirs") / "theirs.step"
    write_step(Lens(FreeformSurface((10.0, 10.0)), rear, 6.0, 1.6), path)
    return path


def test_one_line_says_what_light_a_lens_makes(capsys, strange_lens):
    """As `measure` of the same scene; what does not reach the screen is accounted for."""
    words = "trace", strange_lens, "--source", "led:1mm@12mm", "--at", 50, "--index", 1.5
    found = json.loads(run(capsys, *words, "--json").out)
    assert sum(found["fates_w"].values()) == pytest.approx(1.0, abs=1e-12)
    (line,) = run(capsys, *words).out.splitlines()
    through = float(re.search(r"([0-9.]+) % reaches a screen of [0-9.]+ x [0-9.]+ mm, 50 mm", line)[1])
    assert through == pytest.approx(100 * found["fates_w"]["on_target"], abs=0.051)
    lost = [float(x) for x in re.findall(r"([0-9.]+) % (?:is|misses|meets)", line)]
    assert through + sum(lost) == pytest.approx(100, abs=0.3)
    turned = json.loads(run(capsys, *words, "--turn", "--json").out)
    assert turned["fates_w"]["on_target"] != found["fates_w"]["on_target"]
    bk7 = json.loads(run(capsys, *words[:-2], "--material", "N-BK7", "--json").out)
    assert bk7["fates_w"]["front_reflected"] > found["fates_w"]["front_reflected"]


def test_a_lens_file_that_has_its_index_takes_no_other(capsys, tmp_path):
    path = tmp_path / "lens.json"
    write_lens(Lens(FreeformSurface((10.0, 10.0)), FreeformSurface((10.0, 10.0)), 6.0, 1.6), path)
    said = refused(capsys, "trace", path, "--source", "sun", "--index", 1.5)
    assert "lens.json has its own index; leave --material and --index out" in said


def test_a_problem_without_a_free_face_is_traced(capsys, tmp_path):
    path = write_problem(tmp_path, {"lens.rear.freeform": False}, drop=FREE_REAR)
    done = run(capsys, "trace", path, "--rays", 16, "--out", tmp_path / "traced", "--json")
    assert done.code == 0
    assert json.loads(done.out)["efficiency"] == pytest.approx(0.92, abs=0.01)
    assert (tmp_path / "traced" / "irradiance.png").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], "a lens needs light: add --source"),
        (["--at", "50", "--turn"], "--at and --turn have no effect without --source"),
        (
            ["--source", "sun", "--index", "1.5", "--material", "PC"],
            "--material and --index both give the index",
        ),
        (["--source", "sun", "--rays", "64"], "--rays and --precision have no effect on the one line"),
        (["--source", "moon"], '--source must be "sun", "led:SIZEmm"'),
        (["--source", "led:1mm", "--at", "-3"], "target.distance must be"),
    ],
)
def test_what_a_lens_in_light_needs_is_said(capsys, strange_lens, options, words):
    assert words in refused(capsys, "trace", strange_lens, *options)
