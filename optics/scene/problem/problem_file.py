"""The problem file: TOML into frozen records, every key and value checked.

Unknown keys, wrong types and impossible numbers are UserErrors that name the key.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from optics.base.runtime import UserError, read_at_most, speaking_of
from optics.scene.problem.key_changes import with_changes
from optics.scene.problem.problem_record import Problem
from optics.scene.problem.toml_records import record
from thbcad.toml import toml_tables

MAX_FILE_BYTES = 1_000_000


def load_problem(path: str | Path, changes: Mapping[str, object] | None = None) -> Problem:
    """Read a problem file and return the Problem; its image paths are made absolute.

    changes : {dotted key: value}, in place of what the file says; see `assignment`.

    Raises
    ------
    UserError : with one sentence that names the file, the key, what came and what was wanted.
    """
    path = Path(path)
    text = read_at_most(path, MAX_FILE_BYTES)
    try:
        data = toml_tables(text.decode("utf-8-sig"))  # editors of Windows put a mark before the text
    except UnicodeDecodeError as error:
        raise UserError(f"{path} is no UTF-8 text from byte {error.start} on; save it as UTF-8") from None
    except ValueError as error:
        raise UserError(f"{path} cannot be read as TOML: {error}; mend it there") from None
    with speaking_of(path):
        return record(Problem, with_changes(data, changes or {}), path.parent)
