"""What standards ask of the intensity of a lamp: tables by name, as files that say where they come from."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from thbcad.toml import toml_tables

REGULATIONS = {"FMVSS 108 UB2": "fmvss_108_ub2", "UN R149 class B driving": "un_r149_b_driving"}


class Regulation(NamedTuple):
    """A table of a standard.

    text, edition : what it was copied from.  compared : who compared it, with what.  unit : of its limits.
    zone : the keys of a [[target.zone]] for each of its rows.
    """

    text: str
    edition: str
    compared: str
    unit: str
    zone: list[dict[str, Any]]


@cache
def regulation(name: str) -> Regulation:
    """Return the table of a standard.  name : one of REGULATIONS."""
    data = files("optics.scene.photometry").joinpath(f"{REGULATIONS[name]}.toml").read_text("utf-8")
    return Regulation(**toml_tables(data))
