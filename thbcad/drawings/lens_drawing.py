"""The drawing of a lens: rear and front, two sections, two sides, dimensions and tables on one sheet.

Views stand in third-angle projection round the section x = 0: the front to its left, the rear to its right,
what is seen from -y below the rear.
"""

from __future__ import annotations

import numpy as np

from thbcad.certified import value_range
from thbcad.checks import Floats, require_type
from thbcad.drawings.curves import Style
from thbcad.drawings.dimensions import Marks, caption, centre_line, dimension, hatching, section_mark
from thbcad.drawings.sheets import PlacedView, Sheet, Stroke, number
from thbcad.drawings.title_block import BAND, MARGINS, PAPER, tables
from thbcad.drawings.views import View, plan_view, section_view, side_view
from thbcad.lens import Lens, Product, require_sound

GAP = 27.0  # mm between views at least, for dimensions and titles; a lens of 100 mm is drawn 1:1
SCALES = tuple(a * 10.0**k for k in range(4, -6, -1) for a in (5, 2, 1))
DIGITS = 1e-9  # mm on paper; what rounding coordinates to nine decimals adds
LEVEL = 10.0  # mm between a view and its dimension line


def lens_sheet(lens: Lens, product: Product | None = None, chord: float = 1e-3) -> Sheet:
    """Return the drawing of a lens on an A3 sheet, at the greatest scale of ISO 5455 that it allows.

    product : names and material; None is Product().
    chord : mm, the error that curves may have; the sheet states what they keep.

    Raises
    ------
    ValueError : as `require_sound`, `section_view` and `side_view`; a lens that no scale puts on the sheet.
    """
    require_type("lens", lens, Lens)
    product = Product() if product is None else product
    require_type("product", product, Product)
    require_sound(lens)
    top = (
        plan_view(lens, "front"),
        side_view(lens, "x", chord),
        section_view(lens, "x", chord=chord),
        plan_view(lens, "rear"),
    )
    low = (side_view(lens, "y", chord), section_view(lens, "y", chord=chord))
    scale = _scale(top, low)
    placed = _placed(top, low, scale)
    bound = max(view.bound for view in (*top, *low)) + DIGITS / scale
    sheet = Sheet(product.name, PAPER, scale, bound, tuple(placed))
    sheet = sheet.with_(tables(lens, product, scale, bound))
    for mark in (_captions, _hatched, _axes, _sizes, _thicknesses):
        sheet = sheet.with_(mark(lens, placed, scale))
    return sheet


def _extent(view: View) -> Floats:
    low, high = view.box()
    size: Floats = high - low
    return size


def _room() -> Floats:
    """Return width and height of the sheet that views and their gaps may take."""
    width = PAPER[0] - MARGINS[0] - MARGINS[1]
    return np.array([width, PAPER[1] - 2 * MARGINS[1] - BAND])


def _scale(top: tuple[View, ...], low: tuple[View, ...]) -> float:
    sizes, below = np.array([_extent(view) for view in top]), np.array([_extent(view) for view in low])
    width = sizes[:, 0].sum()
    height = sizes[:, 1].max() + below[:, 1].max()
    room = _room() - [(len(top) + 1) * GAP, 3.2 * GAP]
    fitting = [s for s in SCALES if s * width <= room[0] and s * height <= room[1]]
    if not fitting:
        raise ValueError(f"a lens of {width:.3g} mm over all views fits at no scale on an A3 sheet")
    return max(fitting)


def _placed(top: tuple[View, ...], low: tuple[View, ...], scale: float) -> list[PlacedView]:
    """Return the views at equal gaps: the upper row with one axis y = 0, the lower below front and rear."""
    width = scale * sum(_extent(view)[0] for view in top)
    gap = (_room()[0] - width) / (len(top) + 1)
    height = scale * (max(_extent(v)[1] for v in top) + max(_extent(v)[1] for v in low))
    upright = (_room()[1] - height) / 3.2
    ceiling = PAPER[1] - MARGINS[1] - 1.2 * upright
    axis = ceiling - scale * max(view.box()[1, 1] for view in top)
    x = MARGINS[0] + gap
    placed = []
    for view in top:
        placed.append(PlacedView(view, np.array([x - scale * view.box()[0, 0], axis])))
        x += scale * _extent(view)[0] + gap
    bottom = ceiling - scale * max(_extent(v)[1] for v in top) - upright
    for view, above in zip(low, (placed[0], placed[3])):
        origin = np.array([above.origin[0], bottom - scale * view.box()[1, 1]])
        placed.append(PlacedView(view, origin))
    return placed


def _frame(placed: PlacedView, scale: float) -> Floats:
    """Return the corners of a view on the paper, (2, 2)."""
    frame: Floats = placed.origin + scale * placed.view.box()
    return frame


def _captions(lens: Lens, placed: list[PlacedView], scale: float) -> Marks:
    letters = {"SECTION x = 0": "A-A   x = 0", "SECTION y = 0": "B-B   y = 0"}
    marks: Marks = []
    for one in placed:
        low, high = _frame(one, scale)
        drop = 10.0 if one.view.axes == ("x", "z") else 23.0  # below a dimension and a section mark
        title = letters.get(one.view.title, one.view.title)
        marks.append(caption(title, (float((low[0] + high[0]) / 2), float(low[1] - drop))))
    return marks


def _hatched(lens: Lens, placed: list[PlacedView], scale: float) -> Marks:
    marks: Marks = []
    for one in placed:
        if one.view.title.startswith("SECTION"):
            front, rear, *_ = (one.origin + scale * curve.points for curve in one.view.curves)
            marks += hatching(np.concatenate([front, rear[::-1]]))
    return marks


def _axes(lens: Lens, placed: list[PlacedView], scale: float) -> Marks:
    """Return the optical axis of every view, and on the rear the marks of the sections."""
    marks: Marks = []
    for one in placed:
        low, high = _frame(one, scale)
        x, y = one.origin
        if one.view.axes != ("x", "z"):
            marks.append(centre_line(np.array([low[0], y]), np.array([high[0], y])))
        if one.view.axes != ("z", "y"):
            marks.append(centre_line(np.array([x, low[1]]), np.array([x, high[1]])))
    rear = placed[3]
    (left, bottom), (right, top) = _frame(rear, scale)
    x, y = rear.origin
    upright, level = np.array([(x, bottom), (x, top)]), np.array([(left, y), (right, y)])
    marks += section_mark(upright, np.array([1.0, 0.0]), "A")
    return [*marks, *section_mark(level, np.array([0.0, 1.0]), "B")]


def _sizes(lens: Lens, placed: list[PlacedView], scale: float) -> Marks:
    """Return width and height of the rear, and of the front where it differs."""
    marks: Marks = []
    shown = [(placed[3], lens.rear)]
    if lens.front.half_width != lens.rear.half_width:
        shown.append((placed[0], lens.front))
    for one, surface in shown:
        (_, _), (right, top) = _frame(one, scale)
        half = scale * np.array(surface.half_width)
        low, high = one.origin - half, one.origin + half
        beside = right + 2 * LEVEL, top + 2 * LEVEL  # clear of the section marks
        for axis, level in ((0, beside[1]), (1, beside[0])):
            start = high.copy()
            start[axis] = low[axis]
            marks += dimension(np.array([start, high]), level, axis, number(2 * surface.half_width[axis]))
    return marks


def _thicknesses(lens: Lens, placed: list[PlacedView], scale: float) -> Marks:
    """Return the thickness at the vertex and at the edge of the section x = 0, and of the whole lens."""
    section, side = placed[2], placed[1]
    front, rear = (curve.points for curve in section.view.curves[:2])
    marks: Marks = []
    (_, bottom), (_, top) = _frame(section, scale)
    heights = [float(lens.front(0, 0)[0]), lens.thickness + float(lens.rear(0, 0)[0])]
    axis = np.array([section.origin + scale * np.array([z, 0.0]) for z in heights])
    marks += dimension(axis, bottom - LEVEL, 0, number(heights[1] - heights[0]))
    edge = np.array([section.origin + scale * line[-1] for line in (front, rear)])
    marks += dimension(edge, top + LEVEL, 0, number(float(rear[-1, 0] - front[-1, 0])))
    (left, bottom), (right, _) = _frame(side, scale)
    ends = np.array([(left, bottom), (right, bottom)])
    lowest, highest = (value_range(graph)[k].value for k, graph in enumerate(lens.graphs()))
    return [*marks, *dimension(ends, bottom - LEVEL, 0, number(lens.thickness + highest - lowest))]


def strokes_of_views(sheet: Sheet) -> list[tuple[PlacedView, str, Stroke]]:
    """Return (view, name, stroke) of every curve of the views on the paper, hidden lines first."""
    strokes = [
        (one, curve.name, Stroke(one.origin + sheet.scale * curve.points, curve.style))
        for one in sheet.views
        for curve in one.view.curves
    ]
    return sorted(strokes, key=lambda item: item[2].style is not Style.HIDDEN)
