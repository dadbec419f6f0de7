"""Commands in the shell blocks of pages, and a terminal in a small copy of the checkout that runs them."""

import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass

from optics.interface.commands import main
from tests.cases import EXAMPLES, ROOT

PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
BLOCK = re.compile(r"^( *)```([^\n`]*)\n(.*?)^\1```", re.DOTALL | re.MULTILINE)
SHELL = {"", "sh", "bash", "shell", "console"}
OTHERS = {"python", "python example", "python jax", "python torch", "toml", "text"}
INSTALLED = ".venv/bin/"  # where pages have the program of a checkout


@dataclass(frozen=True)
class Command:
    """A line of a shell block without its comment: the page and the words."""

    page: str
    words: str


def commands_of(path):
    """Return the commands of a page in their order."""
    page = path.relative_to(ROOT).as_posix()
    lines = [
        line.strip().removeprefix("$ ")
        for _, language, code in BLOCK.findall(path.read_text("utf-8"))
        if language.strip() in SHELL
        for line in code.splitlines()
    ]
    return [Command(page, re.split(r"\s+# *", line, maxsplit=1)[0]) for line in lines if line]


def read_by_others(path):
    """Return the languages of the blocks of a page that are neither for a shell nor known."""
    return {found.strip() for _, found, _ in BLOCK.findall(path.read_text("utf-8"))} - SHELL - OTHERS


class Terminal:
    """A folder with the examples, where commands run one after the other; `thbcad` runs in this process.

    folder : has `examples` and `exports`, and is the current one.
    """

    def __init__(self, folder, capsys):
        self.folder, self.capsys = folder, capsys
        for path in EXAMPLES.iterdir():
            (folder / "examples" / path.name).symlink_to(path)
        (folder / "bin").mkdir()
        for name, module in (("thbcad", "-m optics"), ("python", "")):
            program = folder / "bin" / name
            program.write_text(f'#!/bin/sh\nexec "{sys.executable}" {module} "$@"\n')
            program.chmod(0o755)
        self.environment = os.environ | {
            "HOME": str(folder),
            "PYTHONPATH": str(ROOT),
            "PATH": f"{folder / 'bin'}:{os.environ['PATH']}",
        }

    def run(self, words):
        """Run a command, and return its exit code and all that it prints."""
        words = words.replace(INSTALLED, "")
        if words.startswith("thbcad ") and ">" not in words:
            code = main(shlex.split(words)[1:])
            shown = self.capsys.readouterr()
            return code, shown.out + shown.err
        done = subprocess.run(
            ["bash", "-c", words], cwd=self.folder, env=self.environment, capture_output=True, text=True
        )
        return done.returncode, done.stdout + done.stderr
