"""The checkpoint of an unfinished run: JSON that keeps every bit; coefficients as bytes, which are quick."""

import json
from base64 import b64decode, b64encode
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from optics.base.runtime import UserError
from optics.designing.optimisation import Row, State, stages
from optics.exchange.results.identity import fingerprint
from optics.scene.problem import Problem
from optics.scene.system import System
from thbcad.io import read_json, sag_from_dict, sag_to_dict, write_text
from thbcad.surfaces import THBSurface

SCHEMA, VERSION = "thbcad-checkpoint", 5
BYTES = "<f8"  # of a coefficient
MOST = 2.0**63  # no whole number of a history reaches it
DROP = "drop it with --force in place of --resume"


@dataclass(frozen=True)
class Owner:
    """Whose checkpoint it is.

    problems : fingerprints of the problem as it was asked for, and with every "auto" resolved.
    """

    title: str
    problems: tuple[str, str]


def write_checkpoint(
    path: Path, asked: Problem, problem: Problem, state: State, notes: Sequence[str] = ()
) -> None:
    """Store a run's state.  It names the problem, so that no other can go on from it.

    asked : the problem as it was read.  problem : the same with every "auto" resolved.
    """
    data = {
        "schema": SCHEMA,
        "version": VERSION,
        "title": problem.title,
        "problems": [fingerprint(asked), fingerprint(problem)],
        "moved": state.started_from_transport,
        "stage": state.stage,
        "notes": list(notes),
        "sags": [_sag_to_dict(sag) for sag in state.sags],
        "history": [list(asdict(row).values()) for row in state.history],
    }
    write_text(path, json.dumps(data, separators=(",", ":"), allow_nan=False))


def checkpoint_owner(path: Path) -> Owner | None:
    """Return whose checkpoint it is; None where there is none that this version reads."""
    try:
        return _owner(_data(path))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def read_checkpoint(path: Path, system: System) -> tuple[State, list[str]]:
    """Return the State to go on from, and the notes so far.

    Raises UserError : there is none, it is damaged, or it belongs to another problem.
    """
    try:
        data = _data(path)
        same = fingerprint(system.problem) in _owner(data).problems
        moved, stage, history = data["moved"], data["stage"], tuple(Row(*row) for row in data["history"])
        if type(moved) is not bool or type(stage) is not int:
            raise ValueError("moved must be true or false and stage a whole number")
        for row in history:
            numbers = [v for name, v in asdict(row).items() if v is not None or name != "fresh_fit"]
            if not all(type(v) is float or (type(v) is int and abs(v) < MOST) for v in numbers):
                raise ValueError("the history must hold numbers")
        state = State(moved, stage, tuple(map(_sag_from_dict, data["sags"])), history)
        notes = [str(sentence) for sentence in data["notes"]]
    except OSError as error:
        raise UserError(
            f"nothing to resume: cannot read {path}: {error.strerror}; run without --resume"
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise UserError(f"cannot resume: {path} is damaged ({error}); {DROP}") from None
    if not same:
        raise UserError(
            f"cannot resume: {path} belongs to another problem; resume it with the keys it was "
            "stopped with and go on from its result by --from, or run without --resume or change --out"
        )
    last, count = len(stages(system, state.started_from_transport)), len(system.freeforms)
    damage = ""
    if not 0 <= state.stage <= last:
        damage = f"stage {state.stage} of at most {last}"
    elif len(state.sags) != count:
        damage = f"{len(state.sags)} sags instead of {count}"
    if damage:
        raise UserError(f"cannot resume: {path} is damaged ({damage}); {DROP}")
    return state, notes


def _sag_to_dict(sag: THBSurface) -> dict[str, Any]:
    coefficients = sag.coefficients.astype(BYTES).tobytes()
    return sag_to_dict(sag) | {"coefficients": b64encode(coefficients).decode("ascii")}


def _sag_from_dict(data: dict[str, Any]) -> THBSurface:
    coefficients = np.frombuffer(b64decode(data["coefficients"], validate=True), BYTES)
    return sag_from_dict(data | {"coefficients": coefficients.tolist()})


def _data(path: Path) -> dict[str, Any]:
    data: dict[str, Any] = read_json(path, "checkpoint")
    if data["schema"] != SCHEMA or data["version"] != VERSION:
        raise ValueError("unknown schema or version")
    return data


def _owner(data: dict[str, Any]) -> Owner:
    asked, resolved = data["problems"]
    return Owner(str(data["title"]), (str(asked), str(resolved)))
