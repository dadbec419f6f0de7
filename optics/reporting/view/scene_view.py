"""A design as an HTML page to be turned in a browser."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from optics.base.runtime import UserError
from thbcad.io import write_text


@dataclass(frozen=True)
class SceneView:
    """Lens, rays and lit target, to be turned; a notebook shows it by itself.  page : HTML."""

    page: str = field(repr=False)

    def save(self, path: str | Path) -> Path:
        """Write the page to a file, for any browser.

        Raises UserError : the file cannot be written.
        """
        try:
            write_text(Path(path), self.page)
        except OSError as error:
            raise UserError(f"cannot write {path}: {error.strerror}; choose another path") from None
        return Path(path)

    def _repr_html_(self) -> str:
        frame = f'sandbox="allow-scripts" srcdoc="{escape(self.page)}"'
        return f'<iframe {frame} style="width:100%;height:34rem;border:0"></iframe>'
