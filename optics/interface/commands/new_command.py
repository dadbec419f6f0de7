"""`thbcad new`: a commented problem file to start from, printed, or written by three answers."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable
from itertools import count
from math import isfinite
from os.path import expanduser
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError
from optics.interface.commands.outcome import Outcome
from optics.scene.problem import ASKED_LIGHT, ASKED_SOURCES, answered_problem, commented_problem
from thbcad.io import write_text

SMALLEST, LARGEST = 1.0, 1000.0  # mm, of a lens that is asked for


def new(options: Namespace) -> Outcome:
    """Print a problem file to start from; at a terminal and without options, ask and write it."""
    if options.words == ("new",) and all(s is not None and s.isatty() for s in (sys.stdin, sys.stdout)):
        return _asked()
    text = commented_problem(options.kind)
    return Outcome({"problem": text}, text.splitlines())


def _asked() -> Outcome:
    sources, lights = " or ".join(ASKED_SOURCES), " or ".join(ASKED_LIGHT)
    source = _answer(f"Which source: {sources}? [{ASKED_SOURCES[0]}] ", ASKED_SOURCES[0], _source)
    light = _answer(
        f"Which light: even {lights}, or the path of a picture? [{ASKED_LIGHT[0]}] ", ASKED_LIGHT[0], _light
    )
    width = _answer("How wide is the lens, in mm? The rest is in proportion. [100] ", "100", _width)
    path = next(p for k in count(1) if not (p := Path(f"my_lens{f'_{k}' * (k > 1)}.toml")).exists())
    text = answered_problem(source, light, width)
    write_text(path, text)
    lines = [
        f"{path} is written: every key with a comment. Go on with",
        f"  thbcad check {path}",
        f"  thbcad design {path} --live",
    ]
    return Outcome({"problem": text}, lines)


def _answer(question: str, usual: str, read: Callable[[str], Any]) -> Any:
    """Return what `read` makes of an answer; where it is a ValueError, say why and ask again."""
    while True:
        try:
            return read(input(question).strip().strip("'\"") or usual)
        except EOFError:
            print()  # the question has no end of line
            raise UserError("a question has no answer; thbcad new --kind NAME asks none") from None
        except ValueError as error:
            print(error)


def _source(answer: str) -> str:
    if answer.lower() not in ASKED_SOURCES:
        raise ValueError(f"answer {' or '.join(ASKED_SOURCES)}; thbcad new --help has other tasks")
    return answer.lower()


def _light(answer: str) -> str:
    if answer.lower() in ASKED_LIGHT:
        return answer.lower()
    picture = Path(expanduser(answer))  # that of Path fails where "~name" is nobody's
    if not picture.is_file():
        raise ValueError(f"there is no picture {answer}; answer {' or '.join(ASKED_LIGHT)}, or its path")
    return str(picture)


def _width(answer: str) -> float:
    try:
        width = float(answer)
    except ValueError:
        width = float("nan")
    if not (isfinite(width) and SMALLEST <= width <= LARGEST):
        raise ValueError(f"answer a number from {SMALLEST:g} to {LARGEST:g}, in mm")
    return width
