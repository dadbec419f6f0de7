"""What a lens or a mirror passes on at best, in words."""

import pytest

from optics.light.analysis import counted_ways, passing_share, passing_words
from optics.scene.paths import AIR, LightPath, Surface
from optics.scene.receivers import receiver_at
from tests.optics.cases import example_system, small_system
from thbcad.lens import FreeformSurface


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({}, "two uncoated faces at normal incidence pass 92.2%"),
        # 0.99 of the coating, 0.96 of bare glass of index 1.5
        ({"lens.front.reflectance": 0.01}, "front and rear as coated pass 95.0% at normal incidence"),
    ],
)
def test_a_coated_lens_is_said_to_be_one(tmp_path, keys, words):
    system = small_system(tmp_path, keys)
    assert passing_words(passing_share(system.path)) == words


def test_two_mirrors_are_no_lens():
    mirror = Surface(FreeformSurface((5, 5)), kind="reflect", share=0.9)
    path = LightPath((mirror, mirror), (AIR, AIR, AIR), receiver_at(100.0))
    assert passing_words(passing_share(path)) == "the elements pass 81.0% at normal incidence"


@pytest.mark.parametrize(
    ("example", "words"),
    [
        (
            "two_elements",
            "the elements pass 81.1% at normal incidence",
        ),  # 0.96^2 of bare glass, 0.88 of metal
        ("mirror", "the mirror reflects 88.0%"),
    ],
)
def test_a_row_passes_what_all_its_faces_do(example, words):
    system = example_system(example)
    assert passing_words(passing_share(system.path)) == words


def test_the_faces_that_count_are_those_of_the_whole_path():
    mirror = {"element": "mirror", "paths": "sequential"}
    assert counted_ways(mirror) == "the face only"
    assert counted_ways(mirror | {"row_transmittance": 0.8}) == "the faces of the path only"
