"""Luminaire files of both formats: the structure of a text tells which it is, the suffix which to write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from optics.base.runtime import UserError, read_at_most
from optics.scene.luminaires.eulumdat_text import begins_as_ldt, ldt_bytes, luminaire_of_ldt
from optics.scene.luminaires.ies_text import TILT, ies_bytes, luminaire_of_ies, writing_package
from optics.scene.luminaires.intensity_record import Luminaire
from thbcad.io import write_bytes
from thbcad.texts import LATIN, text_of

MOST_BYTES = 20_000_000  # a grid of half a degree over the full sphere takes 2 MB
TITLE = "luminaire"


def read_luminaire(path: str | Path) -> Luminaire:
    """Return the luminaire of an IES LM-63 (1986 to 2019) or EULUMDAT file; its suffix may be any.

    Its planes cover the full turn: what a file leaves out by symmetry is filled in.

    Raises UserError : no such file, no such text, or a file that contradicts itself; one sentence names it.
    """
    path = Path(path)
    data = read_at_most(path, MOST_BYTES)
    try:
        text = text_of(data, LATIN)
    except ValueError as error:
        raise UserError(f"{path} is no text: {error}; give an IES or EULUMDAT file") from None
    if not text.strip():
        raise UserError(f"{path} is empty; give an IES or EULUMDAT file")
    has_tilt, ies = TILT.search(text) is not None, not begins_as_ldt(text)
    try:
        with np.errstate(over="ignore"):  # what is infinite then is refused
            return luminaire_of_ies(text) if has_tilt and ies else luminaire_of_ldt(text)
    except UserError as error:
        kind = "IES LM-63" if has_tilt and ies else "EULUMDAT"
        kind += "" if has_tilt or not ies else " (it has no line TILT= of IES)"
        raise UserError(f"{path}, read as {kind}: {error}") from None


def write_ies(luminaire: Luminaire, path: str | Path, title: str = TITLE) -> None:
    """Write a luminaire as IES LM-63-2019, atomically: see `ies_bytes`.  title : its name, one line."""
    write_bytes(path, ies_bytes(luminaire, title))


def write_ldt(luminaire: Luminaire, path: str | Path, title: str = TITLE) -> None:
    """Write a luminaire as EULUMDAT, atomically: see `ldt_bytes`.  title : its name, one line."""
    write_bytes(path, ldt_bytes(luminaire, title))


def luminaire_writer(suffix: str) -> Callable[[Luminaire, str | Path, str], None]:
    """Return what writes files of a suffix, ".ies" or ".ldt".

    Raises MissingPackage : a package that writes them is not installed.
    """
    if suffix == ".ldt":
        return write_ldt
    writing_package()
    return write_ies
