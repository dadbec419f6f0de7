"""A panel of texts to the right of a drawing, which makes its sheet as wide as an A2 (A3.2 of ISO 5457)."""

from collections.abc import Iterator
from dataclasses import dataclass
from textwrap import wrap

from thbcad.checks import Floats
from thbcad.drawings.annotations import MARGINS, PAPER, Marks
from thbcad.drawings.sheets import ASPECT, SMALL, TEXT, Label, number, rectangle
from thbcad.outlines import Outline

WIDE = (594.0, 297.0)  # mm
LEFT, LOW = PAPER[0] - MARGINS[1], MARGINS[1]
SIZE = (WIDE[0] - PAPER[0], WIDE[1] - 2 * LOW)  # mm, of the panel
MARKS, TEXTS = 35.0, 52.0  # mm from the left, behind the names
LETTER = 1.15 * ASPECT  # of the height: the width that a line reckons with
INSET = 2.0  # mm
PITCH, LEADING = 4.4, 1.6  # mm between lines at most, and in heights of capitals at least
COLUMNS = 6  # of a grid: y, and five of x

Entry = tuple[float, str, str]  # mm from the left, text, anchor


@dataclass(frozen=True, eq=False)
class Grid:
    """Heights (5, m) at x (5,) and y (m,), mm, as a table under a title."""

    title: str
    x: Floats
    y: Floats
    heights: Floats


@dataclass(frozen=True, eq=False)
class Panel:
    """What a sheet has to the right of its views.

    heading : of it.  rows : names, texts and marks.  grids : two, side by side.  foot : sentences
    clear : outlines of front and rear, which the plans show
    """

    heading: str
    rows: tuple[tuple[str, str, str], ...]
    grids: tuple[Grid, Grid]
    foot: tuple[str, ...]
    clear: tuple[Outline, Outline]

    def marks(self) -> Marks:
        """Return its lines on the paper, so near to each other that all have room."""
        lines = [*self._lines()]
        top = LOW + SIZE[1] - 2 * TEXT
        pitch = min(PITCH, (top - LOW - INSET) / len(lines))
        height = min(SMALL, pitch / LEADING)
        marks: Marks = [rectangle((LEFT, LOW), (LEFT + SIZE[0], LOW + SIZE[1]))]
        marks.append(Label(self.heading, (LEFT + INSET, top + TEXT / 2), TEXT))
        for k, entries in enumerate(lines, 1):
            y = top - k * pitch
            marks += [Label(text, (LEFT + x, y), height, anchor) for x, text, anchor in entries]
        return marks

    def _lines(self) -> Iterator[list[Entry]]:
        """Yield the lines, each as what stands in it; an empty one sets apart."""
        for name, text, mark in self.rows:
            first, *others = _wrapped(text, SIZE[0] - TEXTS - INSET)
            yield [(INSET, name, "start"), (MARKS, mark, "start"), (TEXTS, first, "start")]
            yield from ([(TEXTS, other, "start")] for other in others)
        yield []
        width = SIZE[0] / 2
        yield [(INSET + k * width, grid.title, "start") for k, grid in enumerate(self.grids)]
        for row in zip(*map(_cells, self.grids)):
            yield [
                (k * width + (n + 1) * width / COLUMNS - INSET / 2, cell, "end")
                for k, cells in enumerate(row)
                for n, cell in enumerate(cells)
            ]
        yield []
        for sentence in self.foot:
            yield from ([(INSET, text, "start")] for text in _wrapped(sentence, SIZE[0] - 2 * INSET))


def _wrapped(text: str, width: float) -> list[str]:
    return wrap(text, int(width / (LETTER * SMALL)))


def _cells(grid: Grid) -> Iterator[list[str]]:
    """Yield the rows of a grid, the greatest y first, heights to 0.1 um."""
    yield ["y \\ x", *map(number, grid.x.tolist())]
    for y, row in reversed([*zip(grid.y, grid.heights.T)]):
        yield [number(float(y)), *(f"{round(z, 4) + 0.0:.4f}" for z in row.tolist())]
