"""Lists of tables, [[element]] and [[stop]]: read, changed, written, and what is refused."""

import pytest

from optics.base.runtime import UserError
from optics.scene.keys import assignment
from optics.scene.limits import require_limits
from optics.scene.problem import MirrorElement, Problem
from optics.scene.problem.elements import LensElement
from tests.optics.scene.problem.cases import LENS, MIRROR, SMALL, load_text, refusal, toml_text


@pytest.fixture
def mirror(tmp_path):
    return load_text(tmp_path, MIRROR)


def test_a_table_is_the_record_of_its_kind_and_is_written_as_it_was_read(mirror, tmp_path):
    (element,) = mirror.element
    assert isinstance(element, MirrorElement)
    assert mirror.optic is element
    assert mirror.lens is None
    assert load_text(tmp_path, mirror.to_toml()) == mirror


def test_a_lens_is_asked_alike_wherever_it_stands(tmp_path):
    text = MIRROR[: MIRROR.index("[[element]]")] + LENS + MIRROR[MIRROR.index("[target]") :]
    problem = load_text(tmp_path, text)
    assert isinstance(problem.optic, LensElement)
    assert problem.optic.key("rear.radius") == "element.L1.rear.radius"
    assert [*problem.optic.free] == ["rear"]


def test_a_mirror_is_asked_as_a_lens_whose_front_reflects(mirror):
    optic = mirror.optic
    assert [*optic.free] == ["front"]
    assert optic.front.half_width == optic.rear.half_width == (10.0, 10.0)
    assert optic.key("front.radius") == "element.M1.face.radius"
    assert optic.key("thickness") == "element.M1.thickness"
    changed = mirror.with_optic(front=optic.front, rear=optic.rear, thickness=5.0)
    assert changed == mirror.with_(**{"element.M1.thickness": 5.0})


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("element.M1.face.radius=-400", lambda e: e.face.radius == -400.0),
        ("element.M1.reflectance=aluminium", lambda e: e.share == 0.88),
        ("element.0.position=[0, 0, 3]", lambda e: e.position == (0.0, 0.0, 3.0)),
        ("element.M1.face.freeform.spans=[5, 6]", lambda e: e.free["front"].spans == (5, 6)),
    ],
)
def test_a_key_is_set_by_the_name_of_its_table(mirror, text, value):
    key, number = assignment(text, Problem)
    assert value(mirror.with_(**{key: number}).optic)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"element.M2.tilt": (0, 0, 0)}, "there is no element.M2; there are M1"),
        ({"element.M1.tilt": (0, 0)}, "element[0].tilt must be a list of 3 numbers"),
        ({"element.M1.kind": "prism"}, "element[0].kind must be one of 'lens', 'mirror', got 'prism'"),
        ({"element.M1.index": 1.5}, "unknown key element[0].index"),
        ({"element.M1.reflectance": 1.1}, "element[0].reflectance must be at most 1"),
        ({"element.M1.reflectance": "gold"}, "element[0].reflectance must be one of 'aluminium'"),
        ({"element.M1.name": ""}, "element[0].name is missing"),
        ({"element.M1.name": "1"}, "element[0].name must begin with a letter"),
        ({"element.M1.face.half_width": (0, 1)}, "element[0].face.half_width[0] must be at least 1e-06"),
        ({"element.M1.outline": "round", "element.M1.face.half_width": (9, 10)}, "element.M1.outline"),
        (
            {"element.M1.corner_radius": 2.0},
            'element.M1.corner_radius has no effect with element.M1.outline = "rectangle"',
        ),
        ({"element.M1.clear_aperture": (11, 5)}, "element.M1.clear_aperture must lie within"),
        ({"target.distance": 60.0, "target.position": False}, "beside an [[element]] give target.position"),
        ({"target.distance": 60.0}, "target.distance = 60 is that of [lens]; beside an [[element]] give"),
        (
            {"target.distance": float("inf"), "target.position": False},
            "target.distance = inf is that of [lens]",
        ),
        ({"target.position": False}, "the key target.position is missing"),
        ({"target.surface": "far_field"}, "target.position is a place, got [0.0, 60.0, 0.0]"),
        ({"element.M1.position": (0, 0, float("nan"))}, "element[0].position[2] must be a finite number"),
        (
            {"element.M1.rear": {"half_width": (5, 5)}},
            'unknown key element[0].rear: it is that of kind = "lens"',
        ),
        ({"limits.mass": 5.0}, "needs element.M1.density"),
        ({"element": ()}, "the key lens is missing; add it, or an [[element]]"),
        (
            {
                "lens": {"thickness": 1.0, "index": 1.5}
                | {s: {"half_width": (5, 5)} for s in ("front", "rear")}
            },
            "[lens] is a lens on the axis, in place of [[element]]",
        ),
    ],
)
def test_what_is_wrong_with_an_element_is_one_sentence(mirror, changes, words):
    assert words in refusal(lambda: require_limits(mirror.with_(**changes)))


TWO = """
[[stop]]
name = "holder"
shape = "ellipse"
half_width = [8, 8]
position = [0, 0, -1]

[[stop]]
shape = "ring"
half_width = [3, 3]
inner = [1, 1]
position = [0, 0, 30]
hole = false
"""


@pytest.fixture
def two(tmp_path):
    return load_text(tmp_path, toml_text(SMALL) + TWO)


def test_tables_are_read_in_their_order_and_written_as_they_were_read(two, tmp_path):
    assert [stop.shape for stop in two.stop] == ["ellipse", "ring"]
    assert load_text(tmp_path, two.to_toml()) == two
    assert "stop" not in two.with_(stop=()).to_toml()


@pytest.mark.parametrize(("entry", "k"), [("holder", 0), ("0", 0), ("1", 1)])
def test_a_table_is_named_by_its_name_or_its_number(two, entry, k):
    key, value = assignment(f"stop.{entry}.position=[1, 2, -3]", Problem)
    changed = two.with_(**{key: value})
    assert changed.stop[k].position == (1.0, 2.0, -3.0)
    assert changed.stop[1 - k] == two.stop[1 - k]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"stop.rim.hole": True}, "there is no stop.rim; there are holder, 1"),
        ({"stop.2.hole": True}, "there is no stop.2; there are holder, 1"),
        ({"stop.hole": True}, "stop is a list of tables: write stop.NAME.KEY"),
        ({"stop": {"shape": "ring"}}, "stop must be a list of tables, [[stop]], at most 1000"),
        ({"stop": [3]}, "stop[0] must be a table, got 3"),
        ({"stop": [{}]}, "the key stop[0].shape is missing"),
        ({"stop.1.shap": "ring"}, "unknown key stop[1].shap (did you mean stop.NAME.shape?)"),
        ({"stop.1.kind": "ring"}, "unknown key stop[1].kind (did you mean source.kind or target.kind?)"),
        ({"stop.1.name": "holder"}, "stop[1].name must differ from that of stop[0], 'holder'"),
        ({"stop.1.name": "1.a"}, "stop[1].name must begin with a letter"),
        ({"stop.1.inner": (3, 1)}, "stop[1].inner must be above 0 and below stop[1].half_width"),
        ({"stop.holder.inner": (1, 1)}, "stop.holder.inner has no effect with stop.holder.shape"),
        ({"stop.holder.shape": "hexagon"}, "stop[0].shape must be one of"),
        ({"lens.clear_aperture": (100, 3)}, "lens.clear_aperture must lie within front and rear"),
        ({"lens.clear_aperture": (0, 3)}, "lens.clear_aperture = [0.0, 3.0] leaves nothing"),
    ],
)
def test_what_is_wrong_with_a_list_is_said_in_a_sentence(two, changes, words):
    assert words in refusal(two.with_, **changes)


@pytest.mark.parametrize("text", ["stop.holder.positon=[1]", "stop.position=[1, 2, 3]"])
def test_a_key_of_a_list_is_proposed_with_the_place_of_the_name(text):
    with pytest.raises(UserError, match=r"unknown key stop\..*\(did you mean stop\.NAME\.position\?\)"):
        assignment(text, Problem)


def test_light_that_meets_too_many_faces_is_refused_with_their_number(tmp_path):
    """All faces are compiled into one program: 400 of them took minutes without a word."""
    lens = {"kind": "lens", "index": 1.5, "thickness": 3.0, "front": {"half_width": (8.0, 8.0)}}
    fixed = lens | {"rear": {"half_width": (8.0, 8.0), "freeform": False}}
    row = [fixed | {"name": f"L{k}", "position": (0, 0, 5.0 * k)} for k in range(50)]
    row[-1] = row[-1] | {"rear": {"half_width": (8.0, 8.0)}}
    problem = load_text(tmp_path, MIRROR).with_(element=row)
    assert len(problem.faces_met) == 100
    more = [row[0] | {"name": "first", "position": (0, 0, -5.0)}, *row]
    assert "light meets 102 faces, and at most 100 are traced; leave elements out" in refusal(
        problem.with_, element=more
    )
