"""What problems ask for in vain: they say so, and name what can be done."""

import re

import pytest

from optics.scene.keys import assignment, cannot_do, keys_of
from optics.scene.keys.dead_ends import CANNOT
from optics.scene.problem import Problem
from tests.optics.cases import SMALL
from tests.optics.scene.problem.cases import load_values, refusal


def test_what_the_program_has_learned_is_not_called_impossible():
    """An entry whose key exists would never be told, or be told of a misspelt one: it leaves the table."""
    known = {key.name for key in keys_of(Problem)}
    assert {name for name in known if cannot_do(name)} == set()
    choices = {word for key in keys_of(Problem) if key.limits for word in key.limits["choices"] or ()}
    assert {word for word in choices if cannot_do(word)} == set()


def test_a_reason_names_keys_that_exist():
    known = {key.name for key in keys_of(Problem)}
    named = {word for reason in CANNOT.values() for word in re.findall(r"\b[a-z]+(?:\.\w+)+", reason)}
    assert named <= known


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("prism", [{"kind": "mirror"}], "an element is a lens or a mirror"),
        ("lens.kind", "prism", "an element is a lens or a mirror"),
        ("source.kind", "prism", "an element is a lens or a mirror"),
        ("lens.scattering", 0.1, "only its surfaces scatter: lens.front.slope_rms"),
        ("source.polarisation", "s", "sources are not polarised"),
        ("lens.gradient_index", 0.1, "the same everywhere in the lens"),
        ("run.engine", "cuda", "light is traced on the processor"),
        ("target", [{"kind": "tophat"}], "a problem has one target"),
    ],
)
def test_a_dead_end_says_what_the_program_cannot_do_without_a_page(tmp_path, key, value, words):
    told = refusal(load_values(tmp_path, SMALL).with_, **{key: value})
    assert re.search(rf"{re.escape(key)}.*{words}", told)
    assert ".md" not in told  # pages that pip does not install


def test_a_dead_end_of_the_command_line_says_so_too():
    told = refusal(assignment, "lens.kind=prism", Problem)
    assert "unknown key lens.kind; thbcad cannot do that: an element is a lens or a mirror" in told
