"""The faces that light meets: every element in its order, or as [[path]] names them, and what is refused."""

from dataclasses import replace

import pytest

from optics.base.runtime import UserError
from optics.scene.problem import Problem
from tests.optics.scene.problem.cases import refusal

SIZE = (10.0, 10.0)
FREE = {"kind": "mirror", "name": "M1", "position": (0, 0, 60), "thickness": 5, "face": {"half_width": SIZE}}
FREE |= {"tilt": (45, 0, 0)}
SIDES = {"front": {"half_width": SIZE}, "rear": {"half_width": SIZE, "freeform": None}}
FIXED = {"kind": "lens", "name": "L1", "index": 1.5, "thickness": 5, **SIDES}
INSIDE = FIXED | {"name": "P1", "rear": {"half_width": SIZE}}


def problem(elements, faces=None, **more):
    target = {"kind": "tophat", "position": (0, 80, 60), "half_width": SIZE, "pixels": (16, 16)}
    return Problem(
        source={"kind": "collimated", "half_width": (5, 5)},
        element=elements,
        target=target | {"tilt": (-90, 0, 0)},
        path=() if faces is None else ({"faces": faces},),
        **more,
    )


def met(elements, faces=None):
    return [
        (face.name, face.reflects, face.backwards, face.into_glass)
        for face in problem(elements, faces).faces_met
    ]


@pytest.mark.parametrize("name", ["lens", "Scene"])
def test_an_element_of_a_row_is_not_named_like_another_file_of_the_result(name):
    with pytest.raises(UserError, match=rf"is that of a file of the result, {name}\.step; take another"):
        problem([FIXED | {"name": name}, FREE])


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("CON", "= 'CON' would name files that Windows does not take: it means a device; take another"),
        ("a/b", "must begin with a letter and hold letters, digits, _ and - only"),
        ("L1.", "must begin with a letter and hold letters, digits, _ and - only"),
    ],
)
@pytest.mark.parametrize("others", [[], [FIXED]], ids=["alone", "in a row"])
def test_an_element_is_named_so_that_every_system_takes_its_files(name, words, others):
    with pytest.raises(UserError, match=rf"element\[0\]\.name {words}"):
        problem([FREE | {"name": name}, *others])


def test_names_that_some_file_systems_take_for_one_are_refused():
    with pytest.raises(UserError, match=r"element\[1\].name = 'm1' differs from 'M1' only in case"):
        problem([FREE, FIXED | {"name": "m1"}])


def test_light_that_comes_back_through_a_lens_is_refused_as_such():
    with pytest.raises(
        UserError, match=r"faces\[3\]: light that comes back into a lens by its rear, \"L1.rear"
    ):
        _ = problem([FIXED, FREE], ["L1.front", "L1.rear", "M1", "L1.rear", "L1.front"]).faces_met


def test_without_a_path_light_meets_all_elements_in_their_order():
    through = [("L1.front", False, False, True), ("L1.rear", False, False, False)]
    assert met([FIXED, FREE]) == [*through, ("M1.face", True, False, False)]
    assert met([FIXED, FREE], ["L1.front", "L1.rear", "M1"]) == met([FIXED, FREE])
    assert met([FREE, FIXED], ["L1.front", "L1.rear", "M1.face"]) == met([FIXED, FREE])


def test_a_reflection_inside_turns_the_light_until_it_leaves():
    """A Mangin mirror: in by the front, back from the rear, out by the front, to its own -z."""
    assert met([INSIDE], ["P1.front", "P1.rear:reflect", "P1.front"]) == [
        ("P1.front", False, False, True),
        ("P1.rear", True, False, True),
        ("P1.front", False, True, False),
    ]
    twice = ["L1.front", "L1.rear:reflect", "L1.front:reflect", "L1.rear", "M1"]
    assert [row[1:] for row in met([FIXED, FREE], twice)] == [
        (False, False, True),
        (True, False, True),
        (True, True, True),
        (False, False, False),
        (True, False, False),
    ]


@pytest.mark.parametrize(
    ("elements", "faces", "words"),
    [
        (
            [FIXED, FREE],
            ["L1.front", "M1"],
            'light in the glass behind "L1.front" meets "L1.rear" next, not "M1',
        ),
        ([FIXED, FREE], ["L1.front", "L1.rear"], "path[0].faces meets no face of element.M1"),
        ([FIXED, FREE], ["M1"], "path[0].faces meets no face of element.L1"),
        ([FIXED, FREE], ["L1.rear", "L1.front", "M1"], 'write "L1.front" there, or turn the lens round'),
        (
            [FIXED, FREE],
            ["L1.front:reflect", "M1"],
            'enters a lens by its front, refracted; write "L1.front"',
        ),
        ([FIXED, FREE], ["M1", "L1.front"], 'ends in the glass behind "L1.front"'),
        ([FIXED, FREE], ["L2.front", "M1"], "path[0].faces[0] names 'L2', but the elements are L1, M1"),
        ([FIXED, FREE], ["L1", "M1"], '"L1" names no face of a lens; write "L1.front" or "L1.rear"'),
        ([FIXED, FREE], ["M1.back", "L1.front"], 'light meets the face of a mirror only; write "M1"'),
        ([FIXED, FREE], ["M1", "L1.front", "L1.rear", "M1"], 'the free surface "M1.face" twice'),
        (
            [FIXED | {"front": {"half_width": SIZE, "freeform": {}}}],
            ["L1.front", "L1.rear:reflect", "L1.front"],
            'the free surface "L1.front" twice; make the other surface of the lens the free one',
        ),
        (
            [FREE, FIXED | {"front": {"half_width": SIZE, "radius": "auto"}}],
            None,
            "element.L1.front.radius and element.L1.front.conic must be numbers",
        ),
    ],
)
def test_a_path_that_light_cannot_take_is_one_sentence(elements, faces, words):
    assert words in refusal(problem, elements, faces)


def test_one_path_of_elements_can_be_named():
    whole = problem([FIXED, FREE])
    with pytest.raises(UserError, match=r"got 2 tables; keep one"):
        replace(whole, path=2 * ({"faces": ["L1.front", "L1.rear", "M1"]},))
    lens = {"index": 1.5, "thickness": 5, **SIDES, "rear": {"half_width": SIZE}}
    target = {"kind": "tophat", "distance": 60, "half_width": SIZE, "pixels": (16, 16)}
    with pytest.raises(UserError, match=r"got 1 tables beside \[lens\]"):
        replace(whole, lens=lens, element=(), target=target, path=({"faces": ["M1"]},))


def test_from_the_free_element_on_counts_the_throw():
    """60 mm from (0, 0, 0) to the mirror at (0, 0, 60), and 80 mm from there."""
    assert problem([FIXED, FREE]).throw == pytest.approx(80)
    mirror = FREE | {"face": {"half_width": SIZE, "freeform": None}}
    assert problem([INSIDE, mirror]).throw == pytest.approx(140)
