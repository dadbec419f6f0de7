"""What commands show first, against stored screens.  Numbers and the width of gaps are not compared."""

import re
import shutil

import pytest

from optics.base.runtime import Check, verification
from optics.interface.commands import main
from optics.interface.screens import design_screen, screen_text, verify_screen
from tests.cases import DATA, EXAMPLES
from tests.optics.interface.commands.cases import strict_json
from tests.optics.interface.screens.cases import Stream

STORED = (DATA / "screens.txt").read_text("utf-8")
SCREENS = {words: text for words, text in re.findall(r"^\$ (.*)\n((?:[^$\n].*\n)+)", STORED, re.MULTILINE)}
NUMBER, GAP = re.compile(r"\d[\d.]*"), re.compile(r"(?<=\S) {2,}(?=\S)")


def masked(text):
    """Return a screen with # for each number, and two blanks for each gap within a line."""
    return GAP.sub("  ", NUMBER.sub("#", text)).strip()


def assert_as_stored(name, text):
    assert max(map(len, text.splitlines())) <= 80
    assert masked(text) == masked(SCREENS[name]), f"\n$ {name}\n{text}"


@pytest.fixture
def here(golden, tmp_path, monkeypatch):
    """The folder of a result and its problem, which is the current one."""
    shutil.copytree(golden.path, tmp_path / "result")
    shutil.copy(golden.problem, tmp_path / "my.toml")
    for picture in golden.problem.parent.glob("*.png"):
        shutil.copy(picture, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "words",
    [
        "check my.toml",
        "etendue my.toml",
        "verify result --no-optiland",
        pytest.param("tolerance result", marks=pytest.mark.slow),
        pytest.param("tool result --ball 2 --step 0.05", marks=pytest.mark.slow),
    ],
)
def test_screens_of_commands(words, here, capsys):
    main(words.split())
    assert_as_stored(words, capsys.readouterr().out)


def test_the_screen_of_a_road(capsys):
    poles = "--height", "8", "--spacing", "24", "--lenses", "30"
    main(["road", str(EXAMPLES / "lamp.ies"), "--class", "P4", *poles])
    assert_as_stored("road lamp.ies", capsys.readouterr().out)


@pytest.fixture
def design(golden):
    """Metrics and checks of a result."""
    read = [strict_json((golden.path / f"{name}.json").read_text("utf-8")) for name in ("metrics", "verify")]
    return read


def test_the_screen_of_a_design(design, here):
    metrics, checked = design
    screen = design_screen(metrics, checked, here.relative_to(here) / "result", [])
    assert_as_stored("design my.toml --out result", screen_text(screen, Stream()))


def test_a_design_that_fails_shows_each_missed_limit_up_to_four_and_the_remedy(design, here):
    """A limit that is missed comes before one that is not decided."""
    metrics, _ = design
    near = Check("rel_l2, without noise", 0.1, 0.1, "", error=0.01, subject="light")
    low = Check("light on the lit region, of the source's", 0.4, 0.5, "", at_least=True, subject="light")
    broken = [Check(f"faces that are wrong {k}", k, 0, "") for k in range(1, 7)]
    checked = verification([near, low, *broken])
    screen = design_screen(metrics, checked, here.relative_to(here) / "result", ["move the target away"])
    assert_as_stored("design that fails", screen_text(screen, Stream()))


def test_a_file_by_itself_is_judged_without_light():
    screen = verify_screen(verification([Check.none_of("free edges", 0)]), "my.step is a sound solid", ())
    assert screen_text(screen, Stream()) == "PASS  file    my.step is a sound solid (1 check)"
