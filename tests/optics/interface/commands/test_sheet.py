"""`thbcad sheet`: the drawing of a result with its indications, in three formats, read by others."""

import json
import re
from math import cos, pi, radians, sqrt
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from optics.exchange.results import ResultFolder, sha256_of
from optics.tolerancing.form_errors import BandCost, FormErrors, SideCost
from tests.optics.interface.commands.cases import data_of, printed, refused

BANDS = ((1.0, 2.0), (2.0, 20.0))
RMS, PV = (2.5e-4, 4.37e-3), (1e-3, 0.0221)  # mm, by band
COST = {"change_per_mm": 1.0, "by_formula": 1.0, "curvature_part": 0.5, "mtf": 1.0, "slope_cost": 1.0}


def sheet(capsys, *words):
    """Return what the command prints as JSON."""
    return data_of(capsys, "sheet", *words)


def origins(data):
    return {one["name"]: (one["value"], one["origin"]) for one in data["indications"]}


def tolerated(folder, **changes):
    """Write a tolerance.json as of a study with two bands of period, and return its numbers."""
    bands = tuple(
        BandCost(band, allowed_rms=rms, allowed_pv_sine=1.0, allowed_pv_field=pv, traced_rel_l2=0.1, **COST)
        for band, rms, pv in zip(BANDS, RMS, PV)
    )
    sides = tuple(SideCost(face, bands, np.zeros((2, 0, 0)), ()) for face in ("front", "rear"))
    rows = {"thickness": (0.05, 0.0321), "index": (5e-4, None), "front.tilt_x": (0.05, 3.0)}
    data = {
        "run_id": ResultFolder(folder).read().record["run_id"],
        "missed_by_the_design": [],
        "tolerances": {name: {"amount": a, "allowed": b} for name, (a, b) in rows.items()},
        "form_error": {"sentences": []} | FormErrors(0.05, 0.01, sides, 550.0, False).data(),
    }
    (folder / "tolerance.json").write_text(json.dumps(data | changes))


def texts_of(path):
    """Return the texts of a sheet, as a reader of its format finds them."""
    if path.suffix == ".svg":
        root = ElementTree.parse(path).getroot()
        return [item.text for item in root.iter("{http://www.w3.org/2000/svg}text")]
    if path.suffix == ".dxf":
        return [item.dxf.text for item in ezdxf.readfile(path).modelspace().query("TEXT")]
    return pdf_texts(path.read_bytes())


def pdf_texts(data):
    """Return what the one page of a PDF file shows in its text operators, found by its cross-references."""
    start = int(re.search(rb"startxref\s+(\d+)\s+%%EOF\s*$", data)[1])
    first, count = map(int, re.match(rb"xref\s+(\d+) (\d+)\s", data[start:]).groups())
    rows = re.findall(rb"(\d{10}) \d{5} ([nf])", data[start : data.index(b"trailer", start)])
    assert (first, len(rows)) == (0, count)
    places = {number: int(place) for number, (place, kind) in enumerate(rows) if kind == b"n"}
    assert all(re.match(rb"%d 0 obj" % number, data[place:]) for number, place in places.items())

    def entry(number, key):
        body = data[places[number] : data.index(b"endobj", places[number])]
        return int(re.search(rb"/%s \[? ?(\d+) 0 R" % key, body)[1])

    root = int(re.search(rb"/Root (\d+) 0 R", data[start:])[1])
    page = data[places[entry(root, b"Pages")] :]
    content = entry(int(re.search(rb"/Kids \[ (\d+) 0 R \]", page)[1]), b"Contents")
    stream = data[places[content] : data.index(b"endstream", places[content])]
    shown = re.findall(rb"\(((?:\\.|[^\\()])*)\)\s+Tj", stream)
    return [re.sub(rb"\\(.)", rb"\1", text).decode("cp1252") for text in shown]


@pytest.mark.slow
def test_all_formats_hold_the_same_texts_and_repeat(capsys, copy, tmp_path):
    found = {}
    for suffix in ("svg", "dxf", "pdf"):
        out = tmp_path / f"lens.{suffix}"
        data = sheet(capsys, copy, "--out", out, "--manner", "cut")
        before = out.read_bytes()
        assert sheet(capsys, copy, "--out", out, "--manner", "cut") == data
        assert out.read_bytes() == before
        found[suffix] = sorted(texts_of(out))
        assert sum(one["name"] in found[suffix] for one in data["indications"]) == len(data["indications"])
        assert data["ok"]
        assert data["sha256"] == {out.name: sha256_of(out)}
    assert found["svg"] == found["dxf"] == found["pdf"]
    assert b"Date" not in before


def test_the_way_to_give_what_is_open_is_said(capsys, copy, tmp_path):
    assert "--set-indication NAME=VALUE" in printed(capsys, "sheet", copy, "--out", tmp_path / "lens.svg")


def test_what_tolerance_would_tell_is_open_where_it_has_not_run(capsys, copy, tmp_path):
    moulded = sheet(capsys, copy, "--out", tmp_path / "a.svg")
    cut = sheet(capsys, copy, "--out", tmp_path / "b.svg", "--manner", "cut")
    for data, names in ((moulded, "profile.front slope.rear centring"), (cut, "3/rear slope.front 4/ 2/")):
        assert {origins(data)[name] for name in names.split()} == {("to be agreed", "open")}
        assert data["notes"][0].startswith("thbcad tolerance has not run on this result")
        assert data["notes"][0] in texts_of(tmp_path / ("a.svg" if data is moulded else "b.svg"))
    assert origins(cut)["5/rear"] == ("5x0.25", "customary")  # of a lens that is 20 mm wide
    assert not any(name.startswith("6/") for name in origins(cut))
    assert origins(cut)["sha256"] == (sha256_of(copy / "lens.step"), "computed")


def test_tolerances_become_profile_slopes_and_amounts(capsys, copy, tmp_path):
    tolerated(copy)
    found = origins(sheet(capsys, copy, "--out", tmp_path / "lens.svg"))
    steepest = json.loads((copy / "manufacture.json").read_text())["rear"]["slope_degrees"]["upper"]
    width = 22.1 * cos(radians(steepest))
    value, origin = found["profile.rear"]
    assert origin == "computed"
    number = float(value.removesuffix(" um, periods from 2 mm"))
    assert 0.9 * width < number <= width
    slopes = [2e3 * pi * rms / sqrt(low * high) for rms, (low, high) in zip(RMS, BANDS)]
    said = re.findall(r"to (\d+) mm: ([\d.]+) mrad", found["slope.rear"][0])
    assert [int(last) for last, _ in said] == [2, 20]
    assert all(0.9 * slope < float(text) <= slope for slope, (_, text) in zip(slopes, said))
    front, rear = (
        getattr(ResultFolder(copy).read_lens(), face)(0.0, 0.0).item() for face in ("front", "rear")
    )
    assert found["thickness"] == (f"{6 + rear - front:.6g} mm +- 0.032 mm", "computed")  # less is allowed
    assert found["index"] == ("n = 1.5 at 550 nm +- 0.0005", "customary")
    assert found["centring"] == ("3'", "customary")  # a plane has no decentre
    assert found["finish.rear"] == ("polished insert, Ra 10 nm at most", "customary")
    tolerated(copy, missed_by_the_design=["rel_l2"])
    found = origins(sheet(capsys, copy, "--out", tmp_path / "lens.svg"))
    assert found["thickness"] == (f"{6 + rear - front:.6g} mm, tolerance to be agreed", "open")
    tolerated(copy, form_error={"sentences": ["form errors want a point"]})
    data = sheet(capsys, copy, "--out", tmp_path / "lens.svg")
    assert origins(data)["slope.rear"][1] == "open"
    assert "form errors want a point" in data["notes"][0]


def test_an_insert_is_as_smooth_as_the_light_needs(capsys, copy, tmp_path, monkeypatch):
    monkeypatch.setitem(globals(), "RMS", (5.69e-6, 2e-3))
    tolerated(copy)
    found = origins(sheet(capsys, copy, "--out", tmp_path / "lens.svg"))
    assert found["finish.rear"] == ("polished insert, Rq 5.6 nm at most, periods 1 to 2 mm", "computed")


def test_test_points_are_the_sag_to_a_tenth_of_a_micrometre(capsys, copy, tmp_path):
    """By scipy, of the splines and in the table on the sheet."""
    sheet(capsys, copy, "--out", tmp_path / "lens.svg")
    texts = texts_of(tmp_path / "lens.svg")
    table = texts[texts.index("y \\ x") :][: 2 * 36]
    rows = np.array(table).reshape(6, 12)
    graph = ResultFolder(copy).read().lens.rear.graph()
    degrees = graph.kv_u.degree, graph.kv_v.degree
    spline = NdBSpline((graph.kv_u.knots, graph.kv_v.knots), graph.coefficients, degrees)
    x, y, z = rows[0, 7:].astype(float), rows[1:, 6].astype(float), rows[1:, 7:].astype(float)
    assert (x[0], x[-1], y[0], y[-1]) == (-10, 10, 10, -10)
    exact = spline(np.stack(np.meshgrid(x, y), axis=-1))
    assert np.abs(z - exact).max() <= 0.5001e-4
    assert {*rows[1:, 1:6].ravel()} == {"0.0000"}  # a plane


def test_what_is_given_stands_on_the_sheet(capsys, copy, tmp_path):
    words = "--set-indication", "5/rear=2x0.1", "--set-indication", "6/front = 10 J/cm2; 1064 nm"
    data = sheet(capsys, copy, "--out", tmp_path / "lens.pdf", "--manner", "cut", *words)
    assert origins(data)["5/rear"] == ("2x0.1", "given")
    assert origins(data)["6/front"] == ("10 J/cm2; 1064 nm", "given")
    assert "10 J/cm2; 1064 nm  [laser damage threshold]" in texts_of(tmp_path / "lens.pdf")
    gate = sheet(capsys, copy, "--out", tmp_path / "lens.svg", "--set-indication", "gate=-10,3; 10,3")
    assert origins(gate)["gate"] == ("-10,3; 10,3", "given")  # on the rim


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("--set-indication 6/front=", "--set-indication 6/front: it belongs to the other manner"),
        ("--manner cut --set-indication 6/front=", "it must have a value of one line, up to 120 characters"),
        ("--set-indication gate=3,4", "gate: the point 3,4 lies in the clear aperture of the front"),
        ("--set-indication ejectors=20,0;9.9,0", "the point 9.9,0 lies in the clear aperture"),
        ("--set-indication gate=rim", "gate: it must be X,Y in mm, several apart by semicolons"),
        ("--set-indication polish=P4", "there is no such indication; choose from material, index, thickness"),
        ("--set-indication sha256=0", "which the sheet repeats; change the problem and design again"),
        ("--set-indication gate", "--set-indication must be NAME=VALUE, got 'gate'"),
        ("--out lens.png", "--out must end in .svg, .dxf, .pdf, got lens.png"),
        ("--chord 0", "cannot draw"),
    ],
)
def test_refusals(capsys, copy, tmp_path, words, sentence):
    assert sentence in refused(capsys, "sheet", copy, "--out", tmp_path / "lens.svg", *words.split())
    assert not (tmp_path / "lens.svg").exists()


def test_a_result_without_a_verified_file_gets_no_sheet(capsys, copy, tmp_path):
    words = "sheet", copy, "--out", tmp_path / "lens.svg"
    assert "is a file" in refused(capsys, "sheet", copy / "lens.json", *words[2:])
    tolerated(copy, run_id="another")
    assert "tolerance.json belongs to another run" in refused(capsys, *words)
    (copy / "tolerance.json").write_text("[]")
    assert "tolerance.json is damaged" in refused(capsys, *words)
    (copy / "tolerance.json").unlink()
    checked = json.loads((copy / "verify.json").read_text())
    checked["checks"][0]["value"] = 1
    (copy / "verify.json").write_text(json.dumps(checked))
    assert "verify.json is missing or changed" in refused(capsys, *words)
    record = json.loads((copy / "result.json").read_text())
    record["sha256"]["verify.json"] = sha256_of(copy / "verify.json")
    (copy / "result.json").write_text(json.dumps(record))
    name = checked["checks"][0]["name"]
    assert f"lens.step is not verified ({name}): no sheet is made of it" in refused(capsys, *words)
    (copy / "lens.step").write_text("another file")
    assert "lens.step is missing or changed" in refused(capsys, *words)
