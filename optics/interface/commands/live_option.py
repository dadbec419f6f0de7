"""The browser that shows the page of `thbcad design --live`."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path

from optics.base.runtime import note

SCREENS = "DISPLAY", "WAYLAND_DISPLAY"  # environment variables: a browser can be shown on it


def show_in_browser(page: Path) -> None:
    """Say on stderr where a page lies, and open it where a person sits before a screen.

    Without a screen a browser would take over the terminal.
    """
    note(f"watch it in a browser: {page.resolve().as_uri()}")
    if sys.stderr.isatty() and (sys.platform in ("darwin", "win32") or any(map(os.environ.get, SCREENS))):
        webbrowser.open(page.resolve().as_uri())
