"""Every command in a shell block of the pages runs, ends as the page says, and prints the numbers it says.

The tables below say which commands no test can run, and which are made smaller.  Quick tests run the cheap
commands; slow ones run all of a page, as they are printed where `SMALLER` does not say otherwise.
"""

import json
import re
import shlex

import pytest

from benchmarks.rows.quoted_numbers import quoted_rows
from benchmarks.rows.quotes import marked_pages
from benchmarks.rows.stored_rows import read_rows
from optics.interface.commands import main, parsers
from optics.scene.problem import load_problem
from tests.cases import EXAMPLES, ROOT, shared_folder
from tests.optics.cases import write_problem
from tests.page_commands import INSTALLED, PAGES, Terminal, commands_of, read_by_others
from tests.page_files import GIVEN, SMALL, make_folders, prepare

COMMANDS = {path.relative_to(ROOT).as_posix(): commands_of(path) for path in PAGES}
COMMANDS = {page: commands for page, commands in COMMANDS.items() if commands}
GALLERY = "docs/gallery.md"  # its designs take minutes: smaller ones have a test of their own
SPOKEN = re.compile(r"`(?:\.venv/bin/)?thbcad ([a-z]+)((?: [^`]*)?)`")

NOT_RUN = {  # pattern of a command: why no test runs it
    r"make .*": "it installs, or runs the tests themselves; its target is looked up",
    r"pip .*": "it installs packages",
    r"thbcad audit.*": "it measures for minutes; tests/optics/interface/commands/test_audit.py runs it",
    r"thbcad bench .*": "it measures for minutes; its arguments are parsed",
    r"(\.venv/bin/)?python -m pytest .*": "it runs tests; its path is looked up",
    r"dask .*": "another program, which runs until it is stopped",
}
FEW_STEPS = "--set optimizer.iterations=[2] --set optimizer.finish=0"
FEW = f"--set target.pixels=[32,32] --set lens.rear.freeform.max_level=2 {FEW_STEPS}"
SMALLER = {  # pattern of a command: what makes it small, in slow tests too
    r"thbcad tolerance .* --samples 512.*": "--samples 16",
}
QUICKER = {  # the same, in quick tests alone
    r".*thbcad design examples/(my|pearl)\.toml.*": FEW,
}
SLOW = (  # patterns of commands that only slow tests run
    r".*--set target\.(distance=400 --out farther|image=others/astronaut\.png.*)",
    r"thbcad (sweep|tolerance) .*",
    r"thbcad tool .*--nose.*",
    r"thbcad design my\.toml --set lens\.front.*",
    r"thbcad asbuilt .*--errors.*",
)
MISSES = {0, 1}  # exit codes of small problems and designs: their light may miss its limits
ENDS = {  # exit codes that are not 0
    r"thbcad design examples/my\.toml --set target\.image=.*": MISSES,  # as its page says of dark pictures
}
NUMBERS = {  # {command: {row that the page quotes: where the result has the number, and the largest error}}
    "thbcad design examples/my.toml --out DIR": {
        "overview: pearl: rel_l2": ("rel_l2", 0.05),
        "overview: pearl: efficiency": ("efficiency", 0.002),
    },
}


def matches(patterns, words):
    """Return the patterns that fit the whole of a command."""
    return [pattern for pattern in patterns if re.fullmatch(pattern, words)]


def test_every_block_is_for_a_shell_or_names_its_language():
    assert {path.name: read_by_others(path) for path in PAGES if read_by_others(path)} == {}


def test_no_entry_of_the_tables_is_left_over():
    printed = {command.words for commands in COMMANDS.values() for command in commands}
    plain = {words.replace(INSTALLED, "") for words in printed}
    for pattern in (*NOT_RUN, *SMALLER, *QUICKER, *SLOW, *ENDS):
        assert any(re.fullmatch(pattern, words) for words in printed | plain), pattern
    assert {*NUMBERS} <= plain


@pytest.mark.parametrize(
    "words",
    sorted({c.words for commands in COMMANDS.values() for c in commands if matches(NOT_RUN, c.words)}),
)
def test_a_command_that_is_not_run_names_what_exists(words):
    """Targets of make, commands and options of the program, and files of tests."""
    first, *others = shlex.split(words.replace(INSTALLED, ""))
    if first == "make":
        assert {*others} <= {*re.findall(r"^(\w+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)}
    elif first == "thbcad":
        parsers()[1][others[0]].parse_args(others[1:])
    elif first == "python":
        assert [word for word in others if word.startswith("tests/") and not (ROOT / word).exists()] == []


def test_commands_in_sentences_have_the_options_that_they_name():
    known, unknown = parsers()[1], []
    for path in PAGES:
        for name, rest in SPOKEN.findall(path.read_text("utf-8")):
            options = {option.partition("=")[0] for option in re.findall(r"(?<=\s)--[a-z][\w-]*", rest)}
            actions = known[name]._actions if name in known else []
            held = {text for action in actions for text in action.option_strings}
            unknown += [(path.name, name, option) for option in options - held]
            unknown += [] if name in known else [(path.name, name)]
    assert unknown == []


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """Small results under the names that pages have: a picture and an even square."""

    def make(folder):
        write_problem(folder, SMALL, name="pearl.toml")
        even = SMALL | {"target.kind": "tophat"}
        write_problem(folder, even, name="tophat_square.toml", drop=("target.image",))
        for name in ("pearl", "tophat_square"):
            assert main(["design", str(folder / f"{name}.toml"), "--out", str(folder / name)]) in MISSES

    return shared_folder(tmp_path_factory, "results_of_pages", make)


def stored(mark):
    """Return the value of the row of a mark."""
    name, _, row = mark.partition(": ")
    return dict(read_rows(ROOT / "docs" / "data")[name].named())[row]["value"]


def run_page(page, terminal, slow):
    """Run the commands of a page, and hold what they print against it."""
    for command in COMMANDS[page]:
        words = command.words
        if matches(NOT_RUN, words) or (matches(SLOW, words) and not slow):
            continue
        smaller = [SMALLER[pattern] for pattern in matches(SMALLER, words)]
        smaller += [QUICKER[pattern] for pattern in matches(QUICKER, words) if not slow]
        code, text = terminal.run(" ".join([words, *smaller]))
        plain = words.replace(INSTALLED, "")
        wanted = MISSES if smaller or page in GIVEN else {0}
        for pattern in matches(ENDS, plain):
            wanted = ENDS[pattern]
        assert code in wanted, f"{words}: {code}\n{text}"
        if not smaller:
            compare_numbers(page, plain, terminal.folder)


def compare_numbers(page, plain, folder):
    """Hold the numbers of a result against the rows that the page quotes."""
    quoted = {f"{name}: {row}" for name, row in quoted_rows(marked_pages(ROOT).get(ROOT / page, ""))}
    if plain in NUMBERS:
        metrics = json.loads((folder / plain.split("--out ")[1] / "metrics.json").read_text("utf-8"))
        for mark, (key, error) in NUMBERS[plain].items():
            assert mark in quoted
            assert metrics[key] == pytest.approx(stored(mark), rel=error), mark


def runs(page, slow):
    """Return whether a test of a page has a command to run."""
    return any(
        not matches(NOT_RUN, command.words) and (slow or not matches(SLOW, command.words))
        for command in COMMANDS[page]
    )


PAGES_RUN = [page for page in COMMANDS if page != GALLERY]


@pytest.mark.parametrize("page", [page for page in PAGES_RUN if runs(page, slow=False)])
def test_quick_commands_of_a_page_do_what_it_says(page, tmp_path, capsys, monkeypatch, results):
    monkeypatch.chdir(tmp_path)
    prepare(page, tmp_path, results)
    run_page(page, Terminal(tmp_path, capsys), slow=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in PAGES_RUN if any(matches((*SLOW, *QUICKER), c.words) for c in COMMANDS[page])]
)
def test_all_commands_of_a_page_do_what_it_says(page, tmp_path, capsys, monkeypatch, results):
    monkeypatch.chdir(tmp_path)
    prepare(page, tmp_path, results)
    run_page(page, Terminal(tmp_path, capsys), slow=True)


DESIGNS = [command.words for command in COMMANDS[GALLERY] if command.words.startswith("thbcad design ")]


@pytest.mark.slow
@pytest.mark.parametrize("words", DESIGNS, ids=lambda words: words.rpartition("/")[2])
def test_the_commands_of_a_lens_of_the_gallery_run(words, tmp_path, capsys, monkeypatch):
    """On few pixels, in few steps; `make gallery` designs the lenses as they are."""
    monkeypatch.chdir(tmp_path)
    make_folders(tmp_path)
    terminal = Terminal(tmp_path, capsys)
    path, out = EXAMPLES / words.split()[2].removeprefix("examples/"), words.split()[-1]
    pixels = [min(n, 32) for n in load_problem(path).target.pixels]
    few = f"--set target.pixels={json.dumps(pixels, separators=(',', ':'))} {FEW_STEPS}"
    code, text = terminal.run(f"{words} {few}")
    assert code in MISSES, text
    for command in COMMANDS[GALLERY]:
        if command.words.startswith(f"thbcad export {out} "):
            code, text = terminal.run(command.words)
            assert code == 0, text
