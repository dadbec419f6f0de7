"""Files for other programs, read back and compared."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .body import Body
    from .formats import (
        MESHES,
        SOLIDS,
        Labels,
        export,
        format_of,
        labelled_lens,
        moulded_in,
        output_files,
        report_of,
        require_free_files,
    )
    from .indications import indications_of, notes_of, sheet_checks, sheet_of
    from .read_back import READERS, read_mesh, require_readers, triangle_checks
    from .sheet_facts import SheetFacts

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
