"""Arrays of .npz files: plain numbers and text, and a sentence where a file holds something else."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import UserError, require_regular_file
from thbcad.checks import shortened


def read_arrays(path: str | Path, needed: Iterable[str] = ()) -> dict[str, NDArray[Any]]:
    """Return the arrays of an .npz file by name; no array of Python objects is read, so no code runs.

    needed : names that it must have, with numbers.

    Raises UserError : it cannot be read, is damaged, or lacks a needed array.
    """
    require_regular_file(path)
    try:
        file = np.load(path, allow_pickle=False)
        if isinstance(file, np.ndarray):
            raise ValueError("it holds one array without a name")
        with file:
            arrays = {name: file[name] for name in file.files}
            for name, array in arrays.items():
                if not isinstance(array, np.ndarray):  # numpy returns bytes of a member without its mark
                    raise ValueError(f"its member {name} is no .npy array")
    except Exception as error:  # zip files, numpy and zlib may raise anything on a damaged file
        reason = shortened(str(error))
        raise UserError(f"{path} is no file of plain arrays: {reason}; run the design again") from None
    for name in needed:
        if name not in arrays or arrays[name].dtype.kind not in "biuf":
            raise UserError(f"{path} has no array {name} of numbers; run the design again")
    return arrays
