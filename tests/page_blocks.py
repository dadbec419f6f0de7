"""Python blocks of the pages, run as readers run them."""

import re
from contextlib import redirect_stdout
from io import StringIO

BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)


def blocks(page):
    """Return the Python blocks of a page in their order."""
    return BLOCK.findall(page.read_text("utf-8"))


def of_cadquery(block):
    """Return whether a block needs cadquery, which has an environment of its own: there it runs alone."""
    return "import cadquery" in block


def plain(text):
    """Return the words of a text with single blanks between them."""
    return " ".join(text.split())


def unannounced(block, names):
    """Run a block with these names, and return the printed lines that no comment of the block shows."""
    out = StringIO()
    with redirect_stdout(out):
        exec(compile(block, "page", "exec"), names)
    comments = plain(" ".join(line.partition("#")[2] for line in block.splitlines()))
    return [line for line in out.getvalue().splitlines() if plain(line) not in comments]
