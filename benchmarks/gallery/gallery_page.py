"""The page of the gallery: a table of all lenses, and a section for each with its pictures and commands."""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.gallery.lenses import LENSES, Shown
from benchmarks.rows.quoted_numbers import refreshed
from benchmarks.rows.stored_rows import StoredRows

SECONDS, ERROR, UNIFORMITY, LIGHT, FUNCTIONS, SHARE = (
    "process start to verified result",
    "rel_l2",
    "U0",
    "light on the target",
    "degrees of freedom",
    "share of uniform functions",
)
# Rows of other benchmarks that measure the same lens: pages quote each number from one place.
ELSEWHERE = {
    **{
        name: {
            ERROR: f"overview: {name}: rel_l2",
            LIGHT: f"overview: {name}: efficiency",
            SECONDS: f"overview: {name}: {SECONDS}",
        }
        for name in ("pearl", "tophat_square", "tophat_circle")
    },
    **{
        name: {
            ERROR: f"others: {case}",
            LIGHT: f"others: {case} > efficiency",
            SECONDS: f"others: {case} > {SECONDS}",
        }
        for name, case in (
            ("hobby", "hobbyist's photograph: rel_l2"),
            ("text", "text, near target: RRMSE of unit means"),
            ("flat_square", "square from a beam: rel_l2"),
        )
    },
    "extended": {ERROR: "extended: extended: rel_l2, all paths", SECONDS: f"extended: extended: {SECONDS}"},
}
PICTURES = ("scene", "light", "solid", "mesh")
ACROSS = 5  # pictures of the contact sheet in a row
INTRODUCTION = """\
# Gallery

Lenses with their light and the commands that make them, each from one short problem file. `make gallery`
designs all.

- The time is from the start of the command to its report ([machines](benchmarks.md)).
- The error is the relative difference from the light asked for ([`rel_l2`](results.md#the-numbers)), measured
  with light that the optimiser has not seen. It includes the noise of that measurement.
- U0 is the minimum over the mean light of uniform targets ([the verdict](results.md#the-verdict)).
- Functions: their share of the finest uniform mesh ([local refinement](method.md)).
- The light on the target is the fraction of the source flux that arrives there. Two uncoated faces of index
  1.5 reflect 8 % or more.
- Long distances are drawn shorter than they are, fine relief steeper.

**One result to open, without installing anything:** the [report](result/report.html) of the road lamp below,
the [view](result/view.html) that can be turned, the solid [lens.step](result/lens.step), and the exact
surfaces [lens.json](result/lens.json).
"""


def page_text(stored: Mapping[str, StoredRows]) -> str:
    """Return the page as Markdown, with the numbers of the stored rows."""
    head = ["lens", "source", "target", "free", "error", "U0", "light on the target", "functions", "time"]
    uniform = {row["name"].partition(": ")[0] for row in stored["gallery"].rows if UNIFORMITY in row["name"]}
    rows = [_row(lens, lens.name in uniform) for lens in LENSES]
    table = _table([head, *rows], "|---" * 4 + "|---:" * 5)
    return refreshed("\n".join([INTRODUCTION, _contact_sheet(), table, *map(_section, LENSES)]), stored)


def _row(lens: Shown, uniform: bool) -> list[str]:
    words = [f"[{lens.title}]({_anchor(lens)})", lens.source, lens.target, lens.free]
    shown = (ERROR, "0.00 %"), (LIGHT, "0.0 %"), (SHARE, "0.00"), (SECONDS, "0.0 s")
    error, *others = (_mark(lens, row, like) for row, like in shown)
    return [*words, error, _mark(lens, UNIFORMITY, "0.00") if uniform else "", *others]


def _contact_sheet() -> str:
    """Return the light of all lenses as small pictures that lead to their sections."""
    cells = [f"[![{x.title}](gallery/{x.name}_light.webp)]({_anchor(x)})" for x in LENSES]
    cells += [""] * (-len(cells) % ACROSS)
    rows = [cells[k : k + ACROSS] for k in range(0, len(cells), ACROSS)]
    return _table(rows, "|---" * ACROSS)


def _table(rows: list[list[str]], line: str) -> str:
    """Return a table; line : what stands below its first row."""
    first, *others = (f"|{'|'.join(cells)}|\n" for cells in rows)
    return "".join([first, f"{line}|\n", *others])


def _picture(lens: Shown, kind: str) -> str:
    return f"![{kind}](gallery/{lens.name}_{kind}.webp)"


def commands(lens: Shown, out: str) -> list[list[str]]:
    """Return the arguments of the program that make a lens and its body.  out : the result folder."""
    design = ["design", f"examples/{lens.problem}", "--out", out]
    return [design, *([["export", out, *lens.body, "--out", f"{out}.step"]] if lens.body else [])]


def _section(lens: Shown) -> str:
    pictures = _table([[_picture(lens, kind) for kind in PICTURES]], "|---" * len(PICTURES))
    code = "\n".join(f"thbcad {' '.join(one)}" for one in commands(lens, f"exports/{lens.name}"))
    return f"""\
## {lens.title}

{lens.words}

{pictures}
[{lens.problem}](../examples/{lens.problem}):

```
{code}
```
"""


def _mark(lens: Shown, row: str, like: str) -> str:
    """Return a number that `refreshed` fills in; like : its digits and unit."""
    source = ELSEWHERE.get(lens.name, {}).get(row, f"gallery: {lens.name}: {row}")
    return f"{like}<!-- {source} -->"


def _anchor(lens: Shown) -> str:
    """Return the anchor of a section, as code hosts make it."""
    kept = "".join(c for c in lens.title.lower() if c.isalnum() or c in " -")
    return f"#{kept.replace(' ', '-')}"
