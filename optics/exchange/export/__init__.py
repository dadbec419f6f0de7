"""Files for other programs, read back and compared."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .body import Body as Body
    from .formats import (
        MESHES as MESHES,
        SOLIDS as SOLIDS,
        Labels as Labels,
        export as export,
        format_of as format_of,
        labelled_lens as labelled_lens,
        moulded_in as moulded_in,
        report_of as report_of,
        require_free as require_free,
        require_free_files as require_free_files,
    )
    from .read_back import (
        READERS as READERS,
        read_mesh as read_mesh,
        require_readers as require_readers,
        triangle_checks as triangle_checks,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
