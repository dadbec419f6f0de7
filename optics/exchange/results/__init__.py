"""The result folder: one run, one record, nothing replaced unasked."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .array_files import read_arrays
    from .checkpoint import read_checkpoint, write_checkpoint
    from .folder_lock import run_lock
    from .identity import data_of, fingerprint, run_id
    from .owned_files import (
        HASHES,
        LIVE,
        hashes,
        recorded,
        require_own,
        require_places,
        require_room_for_live_page,
        require_writable,
        sha256_of,
        writable_folder,
        write_live_page,
        write_recorded,
    )
    from .result_files import SCENE, beside, level_files, shape_file
    from .result_folder import ResultFolder, lens_of
    from .result_writer import ResultWriter

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
