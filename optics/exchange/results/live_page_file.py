"""The file of the page that shows a run: it belongs to the last run, and no record speaks of it."""

from pathlib import Path

from optics.base.runtime import UserError
from thbcad.io import write_text

LIVE = "live.html"
MARK = "<!-- a live page of thbcad: the next run in this folder replaces it -->\n"


def write_live_page(folder: Path, page: str) -> None:
    """Write the page, with the mark that tells it from files of others."""
    write_text(folder / LIVE, page + MARK)


def remove_live_page(folder: Path) -> None:
    """Remove the page of an earlier run; a file of somebody else stays."""
    path = folder / LIVE
    if path.is_file() and path.read_bytes().endswith(MARK.encode()):
        path.unlink()


def require_room_for_live_page(folder: Path, force: bool) -> None:
    """Raise UserError where a folder, or without `force` a file of somebody else, would be replaced."""
    path = folder / LIVE
    if path.is_dir() or (path.exists() and not force):
        raise UserError(
            f"{path} would be replaced, but is no page of this program; move it, or leave out --live"
        )
