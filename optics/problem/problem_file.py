"""The problem file: TOML into frozen records, every key and value checked.

Unknown keys, wrong types and impossible numbers are UserErrors that name the key.
"""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

from optics.problem.schema import SHORTEST, Problem, Source, Target
from optics.problem.toml_records import record
from optics.runtime import UserError, read_at_most, speaking_of
from thbcad.lens import require_line

MAX_FILE_BYTES = 1_000_000
LEAST_SIGMA = 0.005  # of a Gaussian profile: narrower ones fall between the rays
LEAST_MERGED = 4  # pixels each way that merging leaves


def load_problem(path: str | Path) -> Problem:
    """Read a problem file and return the Problem; its image paths are made absolute.

    Raises
    ------
    UserError : with one sentence that names the file, the key, what came and what was wanted.
    """
    path = Path(path)
    text = read_at_most(path, MAX_FILE_BYTES)
    try:
        data = tomllib.loads(text.decode("utf-8-sig"))  # editors of Windows put a mark before the text
    except UnicodeDecodeError as error:
        raise UserError(f"{path} is no UTF-8 text from byte {error.start} on; save it as UTF-8") from None
    except RecursionError:
        raise UserError(f"{path} is nested too deep for TOML; write it in a simpler way") from None
    except ValueError as error:
        raise UserError(f"{path} is not valid TOML: {error}; mend it there") from None
    with speaking_of(path):
        problem = record(Problem, data, "", path.parent)
        _require_partners(problem)
    return problem


def _require_partners(problem: Problem) -> None:
    """Refuse a problem that lacks a key which another key asks for."""
    for key, text in (
        ("lens.material", problem.lens.material),
        ("export.product", problem.export.product),
        ("export.author", problem.export.author),
        ("export.organization", problem.export.organization),
    ):
        try:
            require_line(key, text)
        except ValueError as error:
            raise UserError(str(error)) from None
    _require_target(problem.target)
    _require_source(problem.source)
    merge, pixels = problem.optimizer.merge, min(problem.target.pixels)
    if merge > 1 and pixels < LEAST_MERGED * merge:
        raise UserError(
            f"optimizer.merge must leave at least {LEAST_MERGED} pixels each way, got {merge} of {pixels}"
        )
    free = [f for f in (problem.lens.front.freeform, problem.lens.rear.freeform) if f]
    most = problem.lens.thickness + sum(f.freedom for f in free)
    if problem.limits.thickness > most and not problem.lens.automatic:
        raise UserError(
            f"limits.thickness must be at most {most:g} mm, lens.thickness and z_freedom together, "
            f"got {problem.limits.thickness:g}"
        )


def _require_target(target: Target) -> None:
    if target.kind == "image" and not target.image:
        raise UserError("the key target.image is missing; add it")
    if target.kind == "function" and not target.formula:
        raise UserError("the key target.formula is missing; add it")
    if math.isinf(target.distance) and max(target.half_width) >= 90:
        raise UserError(
            f"target.half_width must be less than 90 degrees in the far field, got {list(target.half_width)}"
        )


def _require_source(source: Source) -> None:
    if source.profile == "image" and not source.image:
        raise UserError("the key source.image is missing; add it")
    if source.kind == "point" and source.distance < SHORTEST:
        raise UserError(
            f"source.distance must be at least {SHORTEST} for a point, which would lie in the lens, "
            f"got {source.distance!r}"
        )
    if source.kind != "point" and min(source.half_width) < SHORTEST:
        got = list(source.half_width)
        raise UserError(
            f"source.half_width must be at least {SHORTEST} for a {source.kind} source, got {got}"
        )
    if source.kind == "point" and source.profile != "uniform":
        raise UserError(f"source.profile is that of an area, a point has none; got {source.profile!r}")
    if source.profile == "gaussian" and min(source.sigma) < LEAST_SIGMA:
        raise UserError(
            f"source.sigma must be at least {LEAST_SIGMA}, got {list(source.sigma)}; "
            "take a smaller source.half_width"
        )
