"""The command line before any work: help, proposals, changes of keys, completion, what is loaded."""

import json
import re
import shlex
import subprocess
import sys

import pytest

from optics.base.runtime import UserError, note
from optics.interface.commands import main
from optics.interface.commands.arguments import parsed, parsers
from optics.interface.commands.cli import INTERNAL_ERROR
from optics.interface.commands.command_examples import EXAMPLES as SHOWN
from optics.interface.commands.outcome import OF_GRADES
from optics.interface.commands.problem_options import changes_of
from optics.scene.problem import ENGINES, STARTS, load_problem
from tests.cases import EXAMPLES, ROOT
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import QUICK, printed, raising, refused

NAMES = sorted(parsers()[1])
PAGE = (ROOT / "docs" / "commands.md").read_text("utf-8")
SECTIONS = {text.partition("\n")[0]: text for text in PAGE.split("\n## ")[1:]}


def options_of(command):
    return {name for name in parsers()[1][command]._option_string_actions if name not in ("-h", "--help")}


# ---- help ----


def test_the_bare_command_shows_the_way(capsys):
    assert main([]) == 0
    captured = capsys.readouterr()
    first, *steps = captured.out.splitlines()
    assert (first.split()[0], len(steps), captured.err) == ("thbcad", 5, "")
    asked = [parsed(line.split("  ")[1].split()[1:]) for line in steps[:3]]
    assert [options.command for options in asked] == ["new", "check", "design"]
    assert asked[2].live
    assert "exports/my_lens/report.html" in steps[3]
    assert steps[4].startswith("  thbcad --help  ")


def test_the_help_lists_all_commands_and_exit_codes(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    page = capsys.readouterr().out
    assert page.startswith("usage: thbcad")
    assert all(re.search(rf"^ +{name}\b", page, re.MULTILINE) for name in NAMES)
    codes = re.findall(r"(\d+) \w", page.partition("Exit codes: ")[2])
    assert {*map(int, codes)} == {*OF_GRADES.values(), 0, 2, 3, INTERNAL_ERROR, 130, 143}


@pytest.mark.parametrize("name", NAMES)
def test_the_help_of_every_command_shows_examples_that_can_be_given(name, capsys):
    with pytest.raises(SystemExit) as ended:
        main([name, "--help"])
    page = capsys.readouterr().out
    assert ended.value.code == 0
    assert 2 <= len(SHOWN[name]) <= 3
    for line in SHOWN[name]:
        assert f"  {line}\n" in page
        program, *words = shlex.split(line.partition(" > ")[0])
        assert program == "thbcad"
        options = parsed(words)
        assert options.command == name
        if "--set" in words:  # keys of the problem, or amounts of tolerances
            assert options.set if name == "tolerance" else changes_of(options)


@pytest.mark.parametrize("name", NAMES)
def test_every_option_of_a_command_stands_on_the_page_of_commands(name):
    described = SECTIONS[name] + SECTIONS["Options of every command"]
    assert {o for o in options_of(name) if not re.search(rf"`{o}[` ]", described)} == set()
    told = set(re.findall(r"^\| `(--[\w-]+)", SECTIONS[name], re.MULTILINE))
    assert told <= options_of(name)


def test_the_page_of_commands_has_no_other_command():
    assert [s for s in SECTIONS if " " not in s] == [*parsers()[1]]
    assert all(f"`{kind}`" in SECTIONS["new"] for kind in STARTS)


# ---- refusals ----


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("desing my.toml", "there is no command 'desing' (did you mean design?); thbcad --help lists them"),
        ("my.toml", "there is no command 'my.toml' (did you mean design my.toml?)"),
        ("wobble", "there is no command 'wobble'; thbcad --help lists them"),
        ("design a --forse", "there is no option --forse (did you mean --force?); thbcad design --help"),
        ("export a --uot=b.stl", "there is no option --uot (did you mean --out?); thbcad export --help"),
        ("check a --sett x=1", "there is no option --sett (did you mean --set?); thbcad check --help"),
        ("--verison", "there is no option --verison (did you mean --version?); thbcad --help"),
        ("design", "the following arguments are required: PROBLEM.toml; thbcad design --help says more"),
        ("check a b", "unrecognized arguments: b"),
        ("check a -x", "unrecognized arguments: -x"),
        ("trace a --rays many", "argument --rays: invalid int value: 'many'; thbcad trace --help"),
        ("design a --engine exakt", "mitsuba-exact"),
        ("new --kind far", "far_field"),
        ("check ''", "PROBLEM.toml must be a path, got ''; thbcad check --help"),
        ("design a --out ''", "--out must be a path, got ''"),
        ("design a --from=", "--from must be a path, got ''"),
        ("sweep a --vary b=[1] --out ''", "--out must be a path, got ''"),
        ("verify ''", "RESULT must be a path, got ''"),
        ("verify a --lens ''", "--lens must be a path, got ''"),
        ("export a --out a.step --mount ''", "--mount must be a path, got ''"),
        ("etendue a --out ''", "--out must be a path, got ''"),
        ("tolerance a --tolerances ''", "--tolerances must be a path, got ''"),
        ("completion fish", "bash"),
        ("check a -v -q", "not allowed with"),
    ],
)
def test_what_is_no_command_or_option_is_refused_in_one_sentence(words, sentence, capsys):
    assert sentence in refused(capsys, *shlex.split(words))


def test_options_may_be_shortened(tmp_path):
    assert parsed(["design", "my.toml", "--iter", "3", "--res"]).iterations == 3


PROGRAM = """
import json, sys
from optics.interface.commands import main

heavy = {"drjit", "mitsuba", "OCP", "matplotlib", "skimage", "trimesh", "optiland", "lib3mf"}
for line in json.loads(sys.argv[1]):
    print(line, main(line.split()), *sorted(heavy & set(sys.modules)), sep=": ", file=sys.stderr)
"""
LIGHT = {  # command: exit code
    "export none --out lens.foo": 2,
    "export none --out lens.stl --format step": 2,
    "trace none --rays 3": 2,
    "etendue examples/pearl.toml --out bound.jpg": 2,
    "etendue examples/pearl.toml --efficiency 2": 2,
    "design examples/pearl.toml --iterations 3": 2,
    "design examples/pearl.toml --set target.distanse=3": 2,
    "design examples/pearl.toml --set lens.index=0.5": 2,
    "check examples/pearl.toml --set optimizer.engine=exakt": 2,
    "desing examples/pearl.toml": 2,
    "new --kind point": 0,
    "completion zsh": 0,
}


def test_nothing_heavy_is_loaded_for_what_needs_no_work():
    arguments = [sys.executable, "-c", PROGRAM, json.dumps([*LIGHT])]
    done = subprocess.run(arguments, cwd=ROOT, capture_output=True, text=True, check=True)
    said = [line for line in done.stderr.splitlines() if not line.startswith("thbcad: ")]
    assert said == [f"{line}: {code}" for line, code in LIGHT.items()]


# ---- a key from the command line ----


def test_keys_are_changed_in_order_and_the_engine_has_an_option_of_its_own():
    words = "design a --set target.distance=1 --set title=far --set target.distance=2.5 --engine mitsuba-mesh"
    assert changes_of(parsed(words.split())) == {
        "target.distance": 2.5,
        "title": "far",
        "optimizer.engine": "mitsuba-mesh",
    }
    assert changes_of(parsed(["check", "a"])) == {}


@pytest.mark.parametrize("engine", ENGINES)
def test_every_engine_can_be_asked_for(engine, tmp_path):
    changes = changes_of(parsed(["design", "a", "--engine", engine]))
    assert load_problem(write_problem(tmp_path), changes).optimizer.engine == engine


def test_a_key_that_cannot_be_set_is_refused_by_name(tmp_path, capsys):
    path = write_problem(tmp_path)
    for command in ("design", "check", "etendue"):
        line = refused(capsys, command, path, "--set", "target.distanse=3")
        assert line == "thbcad: --set: unknown key target.distanse (did you mean target.distance?)"
        line = refused(capsys, command, path, "--set", "target.distance=-3")
        assert line == f"thbcad: {path}: target.distance must be at least 1e-06, got -3"


@pytest.mark.parametrize(
    "arguments", [["design"], ["sweep", "--vary", "target.distance=[60, 70]"]], ids=" ".join
)
def test_a_folder_is_not_named_after_a_file_whose_name_windows_refuses(arguments, tmp_path, capsys):
    line = refused(capsys, *arguments, write_problem(tmp_path, name="a:b.toml"))
    assert line.startswith("thbcad: the problem file 'a:b")
    assert line.endswith("Windows does not take: ':' in it; choose a folder with --out")


@pytest.mark.slow
def test_a_changed_key_changes_what_a_command_does(tmp_path, capsys):
    path = write_problem(tmp_path)
    out = printed(capsys, "check", path, "--set", "title=other title", "--set", "lens.thickness=7")
    assert out.startswith("other title  ")
    assert "least thickness 7 mm" in out


@pytest.mark.slow
def test_the_result_keeps_the_problem_with_its_changes_and_quiet_runs_say_nothing(tmp_path, capfd):
    path = write_problem(tmp_path, QUICK)
    words = ["design", str(path), "--out", str(tmp_path / "out"), "--set", "target.distance=70", "--quiet"]
    assert main(words) == 0
    assert capfd.readouterr().err == ""
    assert load_problem(tmp_path / "out" / "problem.toml").target.distance == 70.0


# ---- how much is said ----


def test_quiet_keeps_errors(tmp_path, capsys):
    assert "cannot read" in refused(capsys, "check", tmp_path / "none.toml", "--quiet")


def test_quiet_keeps_notes_from_stderr(tmp_path, capsys, monkeypatch):
    def noting(options):
        note("a note")
        raise UserError("an error")

    monkeypatch.setattr("optics.interface.commands.check_command.check", noting)
    assert main(["check", "a", "--quiet"]) == 2
    assert capsys.readouterr().err == "thbcad: an error\n"
    assert main(["check", "a"]) == 2
    assert "a note" in capsys.readouterr().err


@pytest.mark.slow
def test_verbose_says_what_is_skipped_as_explain_does(tmp_path, capsys):
    path = str(write_problem(tmp_path))
    assert main(["check", path, "--verbose", "--explain"]) == 0
    captured = capsys.readouterr()
    told = [line.removeprefix("thbcad: ") for line in captured.err.splitlines()]
    assert len(told) > 3
    assert set(told) <= set(captured.out.splitlines())


@pytest.mark.parametrize(
    "error", [MemoryError(), RuntimeError("jit_malloc(): out of memory! Could not allocate 1024 bytes.")]
)
def test_a_lack_of_memory_is_no_internal_error(error, capsys, monkeypatch):
    monkeypatch.setattr("optics.interface.commands.check_command.check", raising(error))
    assert main(["check", "a"]) == 3
    assert capsys.readouterr().err == "thbcad: out of memory; use fewer pixels, rays or levels\n"


@pytest.mark.parametrize("error", [ZeroDivisionError("nothing"), UserError("bad input")])
def test_verbose_shows_the_traceback_of_what_the_input_did_not_cause(error, capsys, monkeypatch):
    monkeypatch.setattr("optics.interface.commands.check_command.check", raising(error))
    monkeypatch.delenv("THBCAD_DEBUG", raising=False)
    main(["check", "a", "-v"])
    assert ("Traceback" in capsys.readouterr().err) == isinstance(error, ZeroDivisionError)


# ---- completion ----


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_completion_knows_every_command(shell, capsys):
    script = printed(capsys, "completion", shell)
    assert all(re.search(rf"\b{name}\b", script) for name in NAMES)


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["thbcad", "de"], {"design"}),
        (["thbcad", "design", "--eng"], {"--engine"}),
        (["thbcad", "new", "--kind", ""], set(STARTS)),
        (["thbcad", "check", "pearl.t"], {"pearl.toml"}),
        (["thbcad", "tolerance", "lens", "--tolerances", "pearl.t"], {"pearl.toml"}),
        (["thbcad", "verify", "part.step", "--lens", "pearl.t"], {"pearl.toml"}),
        (["thbcad", "asbuilt", "lens", "--out", "pearl.t"], {"pearl.toml"}),
    ],
)
def test_bash_completes_commands_options_choices_and_paths(words, wanted, tmp_path, capsys):
    main(["completion", "bash"])
    (tmp_path / "thbcad.bash").write_text(capsys.readouterr().out)
    program = (
        f"source {tmp_path / 'thbcad.bash'}; COMP_WORDS=({shlex.join(words)}); COMP_CWORD={len(words) - 1}; "
        "_shtab_thbcad; echo ${COMPREPLY[@]}"
    )
    done = subprocess.run(["bash", "-c", program], cwd=EXAMPLES, capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == wanted


def test_a_choice_that_the_program_cannot_make_says_why(capsys):
    told = refused(capsys, "new", "--kind", "prism")
    assert "invalid choice: 'prism'" in told
    assert told.endswith(
        "; thbcad cannot do that: an element is a lens or a mirror: [[element]] says where it lies, "
        "[[path]] how light goes through it"
    )
    assert refused(capsys, "new", "--kind", "square").endswith("; thbcad new --help says more")
