"""`thbcad design --live`: the page of a run, and the browser that shows it."""

from __future__ import annotations

import os
import sys
import webbrowser
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from optics.base.runtime import note
from optics.exchange.results import write_live_page

if TYPE_CHECKING:
    from optics.reporting.live import LiveView

SCREENS = "DISPLAY", "WAYLAND_DISPLAY"  # environment variables: a browser can be shown on it


def live_view(folder: Path) -> LiveView:
    """Return what writes the page of a run into its result folder."""
    from optics.reporting.live import LiveView  # few runs are watched

    return LiveView(partial(write_live_page, folder))


def show_in_browser(page: Path) -> None:
    """Say on stderr where a page lies, and open it where a person sits before a screen.

    Without one a browser would take over the terminal.
    """
    note(f"watch it in a browser: {page.resolve().as_uri()}")
    if sys.stderr.isatty() and (sys.platform == "darwin" or any(map(os.environ.get, SCREENS))):
        webbrowser.open(page.resolve().as_uri())
