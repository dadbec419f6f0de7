"""The page of the gallery: a table of all lenses, and a section for each with its pictures and commands."""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.gallery.lenses import LENSES, Shown
from optics.runtime import StoredRows, refreshed

SECONDS, ERROR, LIGHT, FUNCTIONS = (
    "process start to verified result",
    "rel_l2",
    "light on the target",
    "degrees of freedom",
)
PICTURES = {"scene": "The scene", "light": "The light on the target", "solid": "The solid"}
INTRODUCTION = """\
# Gallery

Every lens here comes from one short problem file. `make gallery` designs all of them, and writes this page
and its pictures.

- The time is that of the whole command, from its start to the verified STEP file, on the machine that
  [benchmarks](benchmarks.md#gallery) names.
- The error is the relative difference from the light asked for (`rel_l2`, [results](results.md)), measured
  with light that the optimiser has not seen. It includes the noise of that measurement.
- The light on the target is the fraction of the source flux that arrives there. Two uncoated faces of index
  1.5 reflect 8 % or more.
- Pictures of light look as a camera shows them. Long distances are drawn shorter than they are. Where a
  surface is finely shaped, its relief is shaded steeper than it is.

**One result to open, without installing anything:** the [report](result/report.html) of the LED lens below,
the [view](result/view.html) that can be turned, the solid [lens.step](result/lens.step) and the exact
surfaces [lens.json](result/lens.json). Code hosts show the text of HTML files: save such a file, and
open it in a browser.
"""


def page_text(titles: Mapping[str, str], stored: Mapping[str, StoredRows]) -> str:
    """Return the page as Markdown.  titles : of the problems, by the names of the lenses."""
    head = ["lens", "source", "target", "free", "error", "time"]
    rows = [
        [f"[{titles[x.name]}](#{_anchor(titles[x.name])})", x.source, x.target, x.free, _error(x), _time(x)]
        for x in LENSES
    ]
    table = [head, ["---"] * 4 + ["---:"] * 2, *rows]
    lines = "\n".join(f"| {' | '.join(cells)} |" for cells in table)
    sections = [_section(lens, titles[lens.name]) for lens in LENSES]
    return refreshed("\n".join([INTRODUCTION, lines, "", *sections]), stored)


def commands(lens: Shown, out: str) -> list[list[str]]:
    """Return the arguments of the program that make a lens and its body.  out : the result folder."""
    design = ["design", f"examples/{lens.problem}", "--out", out]
    return [design, *([["export", out, *lens.body, "--out", f"{out}.stl"]] if lens.body else [])]


def _section(lens: Shown, title: str) -> str:
    pictures = [f"![{what}: {title}](gallery/{lens.name}_{kind}.webp)" for kind, what in PICTURES.items()]
    code = "\n".join(f"thbcad {' '.join(one)}" for one in commands(lens, f"exports/{lens.name}"))
    return f"""\
## {title}

{lens.words}

| {" | ".join(PICTURES.values())} |
|---|---|---|
| {" | ".join(pictures)} |

Error {_error(lens)}, {_mark(lens, LIGHT, "0.0 %")} of the light arrives,
{_mark(lens, FUNCTIONS, "0 000")} coefficients, {_time(lens)}.
Problem file: [{lens.problem}](../examples/{lens.problem}).

```
{code}
```
"""


def _error(lens: Shown) -> str:
    return _mark(lens, ERROR, "0.00 %")


def _time(lens: Shown) -> str:
    return _mark(lens, SECONDS, "0.0 s")


def _mark(lens: Shown, row: str, like: str) -> str:
    """Return a number that `refreshed` fills in; like : its digits and unit."""
    return f"{like}<!-- gallery: {lens.name}: {row} -->"


def _anchor(title: str) -> str:
    """Return the anchor of a heading, as code hosts make it."""
    kept = "".join(c for c in title.lower() if c.isalnum() or c in " -_")
    return kept.replace(" ", "-")
