"""Mount files: every key and every number is checked, in one sentence that names the place."""

import itertools
import math

import pytest

from tests.thbcad.mounts.cases import PLAIN, ROUND, SQUARE, changed
from thbcad.mounts import mount_of, read_mount
from thbcad.mounts.records import Hole, Mount, MountFlange, Places, Post

NUMBERS = [
    "flange__thickness",
    "flange__chamfer",
    "flange__draft",
    "holes__0__diameter",
    "holes__0__countersink",
    "pins__0__diameter",
    "pins__0__length",
    "pins__0__chamfer",
    "gate__width",
    "gate__length",
    "gate__thickness",
    "wall",
    "clearance",
]
NONSENSE = [math.nan, math.inf, -1.0, "3", True, [1.0], None]
TABLES = ["flange", "holes__0", "pins__0", "bosses__0", "gate"]


def refusal(table):
    with pytest.raises(ValueError, match=r"must|unknown|takes") as raised:
        mount_of(table)
    sentence = str(raised.value)
    assert "\n" not in sentence
    return sentence


@pytest.mark.parametrize(("key", "value"), list(itertools.product(NUMBERS, NONSENSE)))
def test_nonsense_is_one_sentence_that_names_the_key(key, value):
    assert key.replace("__0", "").replace("__", ".") in refusal(changed(SQUARE, **{key: value}))


@pytest.mark.parametrize("table", TABLES)
def test_unknown_keys_are_named_with_what_was_meant(table):
    assert "unknown key diametre" in refusal(changed(SQUARE, **{f"{table}__diametre": 1.0}))


def test_what_was_meant_is_proposed():
    assert "did you mean thickness?" in refusal(changed(PLAIN, flange__thicknes=1.0))
    assert "did you mean holes?" in refusal({**PLAIN, "hole": []})


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({}, r"table \[flange\] is missing"),
        ({"flange": 3}, "flange must be a table, got int"),
        ({"flange": {"size": [3, 4]}}, "key flange.thickness is missing"),
        ({"flange": {"thickness": 1}}, "rectangular flange takes flange.size"),
        (changed(PLAIN, flange__diameter=3), "takes flange.size, and not flange.diameter"),
        (changed(PLAIN, flange__outline="oval"), "flange.outline must be one of 'rectangular', 'round'"),
        (changed(PLAIN, flange__size=[1]), "flange.size must be two numbers"),
        (changed(PLAIN, flange__size=[1, math.nan]), "flange.size must be a positive finite number"),
        (changed(PLAIN, flange__seat="top"), "flange.seat must be one of 'front', 'rear'"),
        (changed(PLAIN, flange__seat=math.nan), "flange.seat must be a finite number"),
        (changed(PLAIN, flange__size=[1e300, 30.0]), "flange.size must be at most 100000 in size"),
        (changed(PLAIN, flange__chamfer=0.5), "the flange cuts itself: chamfers of 0.5 mm"),
        (changed(PLAIN, flange__draft=60), "flange.draft must be at most 45 degrees"),
        (
            changed(PLAIN, flange__size=[1.5, 9], flange__draft=45),
            "the flange cuts itself: draft and chamfer",
        ),
        ({**PLAIN, "holes": {}}, "holes must be tables"),
        ({**PLAIN, "holes": [3]}, r"holes\[1\] must be a table"),
        ({**PLAIN, "holes": [{"diameter": 3}]}, r"holes\[1\] must have either at .* or circle and count"),
        (changed(SQUARE, holes__0__at=[[1, 2, 3]]), r"holes\[1\].at must be pairs"),
        (changed(SQUARE, holes__0__at=[[1, math.inf]]), r"holes\[1\].at must be a finite number"),
        (changed(SQUARE, holes__0__at=7), r"holes\[1\].at must be pairs"),
        (changed(ROUND, holes__0__count=2.5), r"holes\[1\].count must be"),
        (changed(ROUND, holes__0__at=[[1, 2]]), "must have either at"),
        (changed(SQUARE, holes__0__count=4), "must have either at"),
        (changed(SQUARE, holes__0__start=30), "must have either at"),
        (changed(SQUARE, flange__chamfer=1e-9), "flange.chamfer must be 0 or at least 1e-06, got 1e-09"),
        (changed(SQUARE, gate__width=1e-9), "gate.width must be at least 1e-06, got 1e-09"),
        (changed(SQUARE, flange__chamfer=1 - 1e-9), "the flange cuts itself"),
        (changed(SQUARE, pins__0__chamfer=1 - 1e-9), "pins.chamfer must be below their length"),
        (changed(SQUARE, holes__0__countersink=2.2 + 1e-9), "holes.countersink must be greater than"),
        (changed(SQUARE, holes__0__countersink=2.0), "holes.countersink must be greater than the diameter"),
        (changed(SQUARE, holes__0__angle=180), "holes.angle must be below 180"),
        (changed(SQUARE, holes__0__side="left"), "holes.side must be one of"),
        (changed(SQUARE, pins__0__chamfer=1.0), "pins.chamfer must be below their length and their wall"),
        (changed(SQUARE, bosses__0__bore=4.0), "bosses.chamfer must be below their length and their wall"),
        (changed(SQUARE, gate__side="x"), "gate.side must be one of"),
    ],
)
def test_bad_mounts_are_one_sentence(table, sentence):
    with pytest.raises(ValueError, match=sentence):
        mount_of(table)


@pytest.mark.parametrize("key", ["flange__thickness", "flange__seat", "holes__0__diameter", "wall"])
def test_integers_beyond_float64_are_one_sentence(key):
    sentence = refusal(changed(SQUARE, **{key: 10**400}))
    assert sentence.endswith("must be a number that float64 can hold, got an integer of about 400 digits")


def test_a_mount_of_lists_is_that_of_tuples():
    size, at = [30.0, 26.0], [[12.0, 0.0]]
    listed = Mount(MountFlange(1.0, size=size), [Hole(Places(at), 2.0)])
    size[0] = at[0][0] = -5.0
    same = Mount(MountFlange(1.0, size=(30.0, 26.0)), (Hole(Places(((12.0, 0.0),)), 2.0),))
    assert listed == same
    assert hash(listed) == hash(same)


@pytest.mark.parametrize("word", ["peg", "", None, 3])
def test_posts_are_pins_or_bosses(word):
    with pytest.raises(ValueError, match="the word of a post must be one of 'pin', 'boss', got"):
        Post(word, Places(((0.0, 12.0),)), 2.0, 3.0)


def test_a_file_is_read_and_its_faults_begin_with_its_path(tmp_path):
    path = tmp_path / "mount.toml"
    path.write_text(
        "wall = 1.0\n[flange]\nsize = [30, 26]\nthickness = 2\n"
        "[[holes]]\ncircle = 28\ncount = 4\ndiameter = 2\n"
    )
    mount = read_mount(path)
    assert mount.wall == 1.0
    assert mount.holes[0].places.points("holes")[1] == pytest.approx((0, 14))
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())  # as an editor of Windows writes it
    assert read_mount(path) == mount
    flange = "[flange]\nsize = [30, 26]\nthickness = "
    for text in ("a = " + 10_000 * "[", "[flange", flange + "nan\n", flange + "1" + 400 * "0", "\xff"):
        path.write_bytes(text.encode("latin-1"))
        with pytest.raises(ValueError, match=str(path)):
            read_mount(path)
