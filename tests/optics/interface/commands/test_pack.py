"""`thbcad pack`: what the zip holds, read and traced by code that did not write it, and what is refused."""

import csv
import io
import json
import struct
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
import trimesh

from optics.exchange.packs import texts
from optics.exchange.results import ResultFolder, sha256_of
from optics.exchange.verification import trace_step
from optics.interface.commands import main
from optics.interface.commands.arguments import parsers
from optics.scene.problem import load_problem
from tests.optics.cases import small_lens, store_result, write_problem
from tests.optics.interface.commands.cases import refused, strict_json
from tests.optics.interface.commands.faulty_disk import FaultyDisk
from thbcad import read_step

PROGRAMS = texts()["programs"]
SHOP = [
    *("README.txt", "lens.step", "lens.stl", "sag_front.dat", "sag_rear.dat", "drawing.svg"),
    *("points_front.xyz", "points_rear.xyz", "compare.csv"),
]
LIGHT = ["ray_table.csv", "irradiance.npz", "irradiance.csv", "irradiance.png"]
SIDE = 64  # of the grid of rays in files


@pytest.fixture(autouse=True)
def _few_rays(monkeypatch):
    monkeypatch.setattr("optics.exchange.packs.expected.MANY", (SIDE, SIDE))


def packed(result, program, out):
    """Return the files of a pack by name."""
    assert main(["pack", str(result), "--for", program, "--out", str(out), "-q"]) == 0
    with ZipFile(out) as archive:
        assert archive.testzip() is None
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture(scope="module")
def packs(golden, tmp_path_factory):
    """All packs of one result."""
    folder = tmp_path_factory.mktemp("packs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("optics.exchange.packs.expected.MANY", (SIDE, SIDE))
        return {name: packed(golden.path, name, folder / f"{name}.zip") for name in PROGRAMS}


def rays_of(data, program):
    """Return positions, directions, fluxes of a ray file, by the layout that its format publishes."""
    if program == "zemax":  # 208 bytes: version, number, ..., unit of length (4: mm) at 136
        assert struct.unpack_from("<2i", data) == (1010, (len(data) - 208) // 28)
        assert struct.unpack_from("<i", data, 136) == (4,)
        table = np.frombuffer(data, "<f4", offset=208).reshape(-1, 7)
    elif program == "lighttools":  # 44 bytes, rows with a wavelength, an end
        assert (data[:4], data[-7:]) == (b"LTRF", b"LTRFEND")
        assert struct.unpack_from("<2i", data, 20) == (2, 1)  # a wavelength in every row; mm
        table = np.frombuffer(data[44:-7], "<f4").reshape(-1, 8)
        assert (table[:, 7] == 550).all()
    else:
        assert data[:4] == b"TM25"
        assert struct.unpack_from("<Q", data, 20) == ((len(data) - 36288) // 28,)
        table = np.frombuffer(data, "<f4", offset=36288).reshape(-1, 7)
    return table[:, :3].astype(float), table[:, 3:6].astype(float), table[:, 6].astype(float)


def table_of(data):
    """Return a CSV as columns by name, empty fields as NaN."""
    head, *rows = csv.reader(io.StringIO(data.decode()))
    return dict(zip(head, np.array([[float(n or "nan") for n in row] for row in rows]).T))


def landings(files, golden, origin, direction, flux, folder):
    """Trace rays through the STEP file of a pack by scipy."""
    (folder / "lens.step").write_bytes(files["lens.step"])
    system = ResultFolder(golden.path).read().system
    index, receiver = system.problem.lens.index, system.target.receiver
    return trace_step(read_step(folder / "lens.step"), origin, direction, flux, index, receiver), system


def test_the_choices_are_the_programs_that_packs_are_for():
    (action,) = (a for a in parsers()[1]["pack"]._actions if a.dest == "program")
    assert action.choices == (*PROGRAMS,)


@pytest.mark.every(4)
@pytest.mark.parametrize("program", PROGRAMS)
def test_a_pack_holds_what_its_people_need_and_says_what_each_file_is(packs, program):
    suffix = PROGRAMS[program]["rays"]
    rays = [f"rays_source{suffix}", f"rays_behind{suffix}"] if suffix else []
    assert sorted(packs[program]) == sorted([*SHOP, *(LIGHT if suffix else []), *rays])
    text = packs[program]["README.txt"].decode()
    assert all(name in text for name in packs[program] if name != "README.txt")
    assert max(map(len, text.splitlines())) <= 100
    assert "{" not in text
    assert ("No version of this program was at hand" in " ".join(text.split())) == bool(suffix)
    assert ("Its middle is (0, 0, 66)" in " ".join(text.split())) == bool(suffix)  # of the screen
    assert PROGRAMS[program]["name"] in text.splitlines()[0]
    assert "z = 6." in text  # the rear's vertex


@pytest.mark.slow
def test_the_same_result_makes_the_same_bytes_without_dates(golden, packs, tmp_path):
    again = tmp_path / "again.zip"
    packed(golden.path, "zemax", again)
    packed(golden.path, "zemax", tmp_path / "other.zip")
    assert sha256_of(again) == sha256_of(tmp_path / "other.zip")
    with ZipFile(again) as archive:
        assert {info.date_time for info in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert archive.namelist() == [*packs["zemax"]]


def test_part_and_light_are_those_of_the_result_and_the_mesh_is_closed(golden, packs):
    for files in packs.values():
        assert files["lens.step"] == (golden.path / "lens.step").read_bytes()
        mesh = trimesh.load_mesh(io.BytesIO(files["lens.stl"]), file_type="stl")
        lens = ResultFolder(golden.path).read_lens()
        assert mesh.is_watertight
        assert abs(mesh.volume - lens.volume()) < 0.01 * mesh.area
    light = np.load(io.BytesIO(packs["speos"]["irradiance.npz"]))
    image = np.genfromtxt(io.BytesIO(packs["speos"]["irradiance.csv"]), delimiter=",")
    np.testing.assert_allclose(image[1:, 1:], 1e6 * light["irradiance"], rtol=1e-8)
    np.testing.assert_allclose(image[0, 1:], light["x"], rtol=1e-8)
    np.testing.assert_allclose(image[1:, 0], light["y"], rtol=1e-8)


def test_scipy_lands_the_listed_rays_of_the_step_file_where_the_table_says(golden, packs, tmp_path):
    rays = table_of(packs["zemax"]["ray_table.csv"])
    origin, direction = (
        np.column_stack([rays[n] for n in names]) for names in (("x_mm", "y_mm", "z_mm"), "lmn")
    )
    assert len(origin) == 10_000
    traced, _ = landings(packs["zemax"], golden, origin, direction, rays["flux_W"], tmp_path)
    lost = np.isnan(rays["landing_u_mm"])
    assert ((traced.flux == 0) == lost).all()
    listed = np.column_stack([rays["landing_u_mm"], rays["landing_v_mm"]])[~lost]
    assert np.abs(traced.points[~lost] - listed).max() < 1e-8
    np.testing.assert_allclose(traced.flux[~lost], rays["landing_flux_W"][~lost], rtol=1e-10)


@pytest.mark.parametrize("program", ["zemax", "lighttools", "speos"])
def test_what_its_people_do_gives_the_numbers_of_the_table(golden, packs, program, tmp_path):
    """Read the ray file, trace the part, sort the rays into the pixels: by numpy and scipy alone."""
    files, suffix = packs[program], PROGRAMS[program]["rays"]
    origin, direction, flux = rays_of(files[f"rays_source{suffix}"], program)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    traced, system = landings(files, golden, origin, direction, flux, tmp_path)
    hit, (hx, hy), (columns, rows) = traced.flux > 0, (20.0, 20.0), (48, 48)
    grid = {"bins": (columns, rows), "range": [(-hx, hx), (-hy, hy)], "weights": traced.flux[hit]}
    light = np.histogram2d(*traced.points[hit].T, **grid)[0].T[::-1] / (2 * hx / columns * 2 * hy / rows)
    target = np.load(io.BytesIO(files["irradiance.npz"]))["target"]
    e, t = light / light.mean(), target / target.mean()
    found = {
        "efficiency": light.sum() * 4 * hx * hy / (columns * rows),
        "rel_l2": np.linalg.norm(e - t) / np.linalg.norm(t),
        "peak irradiance": 1e6 * light.max(),
    }
    table = {row["quantity"]: row for row in csv.DictReader(io.StringIO(files["compare.csv"].decode()))}
    for name, number in found.items():
        assert number == pytest.approx(float(table[name]["by the rays of this pack"]), rel=1e-6)
    metrics = json.loads((golden.path / "metrics.json").read_text())
    assert float(table["efficiency"]["of the lens"]) == pytest.approx(metrics["efficiency"], rel=1e-8)
    assert float(table["rel_l2"]["of the lens"]) == pytest.approx(metrics["rel_l2"], rel=1e-8)
    assert float(table["volume"]["of the lens"]) == pytest.approx(system.base.volume(), rel=0.1)
    behind = rays_of(files[f"rays_behind{suffix}"], program)
    assert behind[2].sum() == pytest.approx(traced.flux.sum(), rel=1e-6)
    shares = (66.0 - behind[0][:, 2]) / behind[1][:, 2]
    onto = behind[0][:, :2] + shares[:, None] * behind[1][:, :2]
    assert np.abs(onto - traced.points[hit]).max() < 1e-4  # single precision over 60 mm


def test_the_shop_gets_no_light(packs):
    assert not any("ray" in name or "irradiance" in name for name in packs["shop"])
    assert "irradiance" not in packs["shop"]["compare.csv"].decode()


def test_the_report_beside_the_zip_has_its_checks_and_its_hash(golden, tmp_path, capsys):
    out = tmp_path / "pack.zip"
    assert main(["pack", str(golden.path), "--for", "shop", "--out", str(out), "--json"]) == 0
    report = strict_json(Path(f"{out}.json").read_text("utf-8"))
    assert strict_json(capsys.readouterr().out) == report
    assert report["sha256"] == {"pack.zip": sha256_of(out)}
    assert report["contents"] == SHOP
    assert report["ok"]
    bounds = {c["name"]: c["value"] for c in report["checks"] if c["name"].endswith("bound")}
    assert bounds["rear points, linear between them, bound"] <= 1e-3
    assert bounds["rear points, cubic between them, bound"] <= 1e-6


# ---- refusals ----


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--for", "oslo"], "invalid choice: 'oslo'"),
        (["--for", "shop", "--out", "pack.tar"], "let --out end in .zip"),
        (["--for", "shop", "--out", "none/pack.zip"], "there is no folder"),
        (["--for", "shop", "--out", "/proc/pack.zip"], "cannot write /proc/pack.zip"),
        (["--out", "pack.zip"], "the following arguments are required: --for"),
    ],
)
def test_wrong_words_are_one_sentence(golden, capsys, tmp_path, monkeypatch, words, sentence):
    monkeypatch.chdir(tmp_path)
    words = words if "--out" in words else [*words, "--out", "pack.zip"]
    assert sentence in refused(capsys, "pack", golden.path, *words)
    assert [*tmp_path.iterdir()] == []


def test_a_result_without_a_verified_step_file_is_refused(copy, capsys, tmp_path):
    out = tmp_path / "pack.zip"
    assert "is none" in refused(capsys, "pack", copy / "lens.json", "--for", "shop", "--out", out)
    bare = store_result(tmp_path / "bare", load_problem(write_problem(tmp_path)), small_lens())
    assert "lens.step, verify.json" in refused(capsys, "pack", bare.path, "--for", "shop", "--out", out)
    with (copy / "lens.step").open("a") as file:
        file.write("\n")
    assert "lens.step is missing or changed" in refused(capsys, "pack", copy, "--for", "zemax", "--out", out)
    assert not out.exists()


def test_a_step_file_that_failed_a_check_is_refused(copy, capsys, tmp_path):
    verified = json.loads((copy / "verify.json").read_text())
    check = next(c for c in verified["checks"] if c["subject"] == "file")
    check |= {"value": 7}
    (copy / "verify.json").write_text(json.dumps(verified))
    record = json.loads((copy / "result.json").read_text())
    record["sha256"]["verify.json"] = sha256_of(copy / "verify.json")
    (copy / "result.json").write_text(json.dumps(record))
    said = refused(capsys, "pack", copy, "--for", "shop", "--out", tmp_path / "pack.zip")
    assert f"is not verified: {check['name']} failed" in said


@pytest.mark.parametrize(
    ("changes", "program", "what"),
    [
        (
            {"lens.array": {"columns": 2, "rows": 1, "pitch": [22.0, 22.0]}},
            "shop",
            "a plate of lenses: design one lens of it by --set lens.array=false",
        ),
        ({"lens.rear.slope_rms": 0.001}, "speos", "rough faces"),
        ({"target.surface": "cylinder", "target.radius": 100.0}, "zemax", "a curved screen"),
    ],
)
def test_what_a_pack_cannot_hold_is_refused(monkeypatch, capsys, tmp_path, changes, program, what):
    monkeypatch.setattr("optics.exchange.packs.contents._verified", lambda folder: {})
    problem = load_problem(write_problem(tmp_path, changes))
    folder = store_result(tmp_path / "result", problem, small_lens())
    out = tmp_path / "pack.zip"
    assert f"has {what}" in refused(capsys, "pack", folder.path, "--for", program, "--out", out)
    assert not out.exists()


def test_a_file_of_others_is_not_replaced_and_a_full_disk_leaves_the_old_pack(golden, capsys, tmp_path):
    out = tmp_path / "pack.zip"
    out.write_bytes(b"mine")
    words = ["pack", golden.path, "--for", "shop", "--out", out]
    assert "would be replaced" in refused(capsys, *words)
    with FaultyDisk().installed() as counted:
        assert main([*map(str, words), "--force", "-q"]) == 0
    capsys.readouterr()
    out.write_bytes(b"mine")
    with FaultyDisk("ENOSPC", counted.count // 2).installed():
        assert "No space left on device" in refused(capsys, *words, "--force")
    assert out.read_bytes() == b"mine"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["pack.zip", "pack.zip.json"]
