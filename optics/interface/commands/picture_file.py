"""The picture that --out of a command asks for."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from optics.base.runtime import UserError
from optics.exchange.results import require_own, require_writable


def picture_path(options: Namespace) -> Path | None:
    """Return where --out wants a picture, None without it; checked before any work is done.

    Raises
    ------
    UserError : it does not end in .png, cannot be written, or would replace what is not ours.
    """
    if not options.out:
        return None
    out = Path(options.out)
    if out.suffix.lower() != ".png":
        raise UserError(f"--out must end in .png, since the picture is a PNG, got {out}")
    require_writable(out)
    require_own(out.parent, (out.name,), "", options.force)
    return out
