"""The file of the page that shows a run while it goes on.

It belongs to the run that goes on and claims nothing of a result: no record speaks of it, and a mark at its
end tells it from files of others.
"""

from __future__ import annotations

from pathlib import Path

from optics.base.runtime import UserError
from thbcad.io import write_text

LIVE = "live.html"
MARK = "<!-- a live page of thbcad: the next run in this folder replaces it -->\n"


def write_live_page(folder: Path, page: str) -> None:
    """Write the page.

    Raises OSError : it cannot be written.
    """
    write_text(folder / LIVE, page + MARK)


def remove_live_page(folder: Path) -> None:
    """Remove the page of an earlier run; a file of somebody else stays."""
    path = folder / LIVE
    if path.is_file() and path.read_bytes().endswith(MARK.encode()):
        path.unlink()


def require_room_for_live_page(folder: Path, force: bool) -> None:
    """Raise UserError where a file of somebody else would be replaced; without `force`, or a folder."""
    path = folder / LIVE
    if path.is_dir() or (path.exists() and not force):
        raise UserError(
            f"{path} would be replaced, but is no page of this program; move it, choose another --out, or "
            "leave out --live"
        )
