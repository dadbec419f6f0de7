"""The result folder: one run, one record, nothing replaced unasked."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .checkpoint import read_checkpoint as read_checkpoint, write_checkpoint as write_checkpoint
    from .folder_lock import run_lock as run_lock
    from .identity import data_of as data_of, fingerprint as fingerprint, run_id as run_id
    from .owned_files import (
        HASHES as HASHES,
        hashes as hashes,
        recorded as recorded,
        remove_files as remove_files,
        require_own as require_own,
        require_writable as require_writable,
        sha256_of as sha256_of,
        writable_folder as writable_folder,
    )
    from .result_folder import (
        FIGURES as FIGURES,
        FILES as FILES,
        SCENE as SCENE,
        ResultFolder as ResultFolder,
        lens_of as lens_of,
        level_files as level_files,
        shape_file as shape_file,
    )
    from .result_writer import ResultWriter as ResultWriter

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
