"""Scenes as files: Mitsuba reads them by itself, and sees the light that we compute."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("mitsuba")

from optics.exchange.mitsuba import scene
from optics.exchange.mitsuba.loading import load_mitsuba
from optics.exchange.mitsuba.scene import REFLECTANCE
from optics.exchange.mitsuba.scene_xml import irradiance_of_one, scene_checks, scene_file_names, scene_files
from optics.scene.problem import load_problem
from optics.scene.receivers import PixelWindow
from optics.scene.system import System
from tests.optics.cases import picture, rough
from tests.optics.exchange.mitsuba.cases import exact_image
from tests.optics.scene.problem.cases import ROW, load_text
from thbcad.surfaces import THBSurface

RENDER = """
import sys, numpy, mitsuba
mitsuba.set_variant("llvm_ad_mono")
picture = mitsuba.render(mitsuba.load_file(sys.argv[1]), spp=int(sys.argv[2]))
numpy.save(sys.argv[3], numpy.array(picture))
"""
POINT = {"source.kind": "point", "source.half_width": [0.0, 0.0], "source.distance": 30.0}
CASES = {
    "beam": {},
    "picture": {"source.profile": "image", "source.image": "source.png"},
    "disk": {"source.profile": "round"},
    "spot": POINT | {"source.half_angle": 12.0},
    "glowing": {"source.kind": "lambertian", "source.distance": 30.0},
}


@pytest.fixture(autouse=True)
def mi(monkeypatch):
    """Mitsuba, and meshes of 65 vertices in each direction."""
    monkeypatch.setattr(scene, "VERTICES", (65, 65))
    return load_mitsuba()


@pytest.fixture
def make(problem_file, tmp_path):
    """A function that returns (system, lens, XML file) of the small problem with changes."""

    def build(changes):
        Image.fromarray(picture(24, 16)).save(tmp_path / "source.png")
        system = System(load_problem(problem_file(changes)))
        lens = system.base.with_sags([THBSurface(s.space, rough(s.space, 0.1)) for s in system.base.sags])
        out = tmp_path / "scene.xml"
        files = scene_files(system.with_lens(lens), out)
        assert set(files) <= set(scene_file_names(system, out))
        for path, data in files.items():
            path.write_bytes(data)
        return system, lens, out

    return build


@pytest.mark.parametrize("name", CASES)
def test_mitsuba_reads_every_source_and_the_lens(mi, make, name):
    system, lens, out = make(CASES[name])
    assert all(check.ok for check in scene_checks(system.with_lens(lens), out))
    given = scene.mitsuba_scene(system, scene.LensMesh.uniform(lens, (65, 65)))
    given, read = (mi.traverse(s) for s in (given, mi.load_file(str(out), optimize=False)))
    compared = [key for key, _ in given if key in read]
    assert {"front.vertex_normals", "rear.faces", "screen.to_world", "sensor.x_fov"} <= set(compared)
    assert any(key.startswith("source.") for key in compared)
    brighter = np.pi / REFLECTANCE / irradiance_of_one(system)
    for key in compared:
        if key != "edges.vertex_normals":
            rows = [np.array(getattr(p[key], "matrix", p[key]), dtype=float) for p in (given, read)]
            light = any(
                f"{word}.{kind}" in key for word in ("radiance", "intensity") for kind in ("value", "data")
            )
            np.testing.assert_allclose(rows[0] * (brighter if light else 1), rows[1], rtol=1e-6, atol=1e-6)


def test_elements_have_files_where_they_lie(mi, tmp_path):
    """Mitsuba reads the faces of both in the frame of the scene, as it has them of the scene in memory."""
    system = System(load_text(tmp_path, ROW))
    files = scene_files(system, tmp_path / "scene.xml")
    assert set(files) <= set(scene_file_names(system, tmp_path / "scene.xml"))
    for path, data in files.items():
        path.write_bytes(data)
    checks = scene_checks(system, tmp_path / "scene.xml")
    assert [check.name.split(",")[0][16:] for check in checks] == [
        "L1.front",
        "L1.rear",
        "M1.front",
        "M1.rear",
    ]
    assert all(check.ok for check in checks)
    given = mi.traverse(scene.mitsuba_scene(system, scene.LensMesh.uniform(system.base, (65, 65))))
    read = mi.traverse(mi.load_file(str(tmp_path / "scene.xml"), optimize=False))
    for key in (
        "M1_front.vertex_positions",
        "L1_edges.vertex_positions",
        "screen.to_world",
        "sensor.to_world",
    ):
        rows = [np.array(getattr(p[key], "matrix", p[key]), dtype=float) for p in (given, read)]
        np.testing.assert_allclose(*rows, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_files_render_visibly_by_both_cameras_and_name_a_sampler(mi, make):
    """1 is the target's brightest light; the overview has the lit screen, and the lens dark before it."""
    system, _, out = make({"target.kind": "tophat", "target.shape": "rectangle", "target.lit": [0.75, 0.75]})
    read = mi.load_file(str(out))
    sensors = read.sensors()
    assert len(sensors) == 2
    assert [sensor.sampler().sample_count() for sensor in sensors] == [256, 16]
    light = np.array(mi.render(read, sensor=0, spp=64))[..., 0]
    lit = system.target.light > 0.5
    assert 0.3 < light[lit].mean() < 1.2
    overview = np.array(mi.render(read, sensor=1, spp=16))[..., 0]
    seen = overview > 0.1
    assert 0.02 < seen.mean() < 0.9
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    within = overview[rows[0] : rows[-1], columns[0] : columns[-1]]
    blocks = within[: len(within) // 8 * 8, : within.shape[1] // 8 * 8]
    blocks = blocks.reshape(len(blocks) // 8, 8, -1, 8).mean(axis=(1, 3))
    assert (blocks < 1e-3).sum() > 5  # behind the lens


@pytest.mark.slow
def test_a_process_that_knows_mitsuba_alone_sees_our_light(make, backend, tmp_path):
    """6 x 6 blocks of 8 x 8 pixels with 256 paths each: noise of about 1 %, as of the scene in memory."""
    system, lens, out = make({})
    image = tmp_path / "image.npy"
    subprocess.run([sys.executable, "-c", RENDER, str(out), "256", str(image)], check=True)
    seen = irradiance_of_one(system) * np.load(image)[:, ::-1, 0]
    exact = exact_image(backend, system, lens, (301, 301), PixelWindow())
    blocks = [a.reshape(6, 8, 6, 8).mean((1, 3)) for a in (seen, exact)]
    assert np.linalg.norm(blocks[0] - blocks[1]) < 0.03 * np.linalg.norm(blocks[1])
