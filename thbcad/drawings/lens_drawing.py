"""The drawing of a lens: rear and front, two sections, two sides, dimensions and tables on one sheet.

Views stand in third-angle projection: what is seen from -x to the right of the front, what is seen from -y
below it, front at the top, so that every point lies right of and below its place in the front.  Of the rear
the section across x stands to the left, the section across y below.  A lens that is cut to an outline, or has
a flange, is drawn with it.
"""

from collections.abc import Sequence

import numpy as np

from thbcad.certified import value_range
from thbcad.checks import Floats, require_number, require_type
from thbcad.drawings.annotations import (
    BAND,
    MARGINS,
    PAPER,
    Marks,
    centre_line,
    dimension,
    hatching,
    section_mark,
    tables,
)
from thbcad.drawings.curves import Style, View
from thbcad.drawings.cut_outlines import CutLens, box_of, cut_lens, intervals, is_circle, ring_of
from thbcad.drawings.cut_views import cut_plan, cut_section, cut_side
from thbcad.drawings.panels import WIDE, Panel
from thbcad.drawings.sheets import TEXT, Label, PlacedView, Sheet, Stroke, line, number
from thbcad.drawings.views import plan_view, section_view, side_view
from thbcad.lens import LEAST_CHORD, Flange, Lens, Product, require_sound

GAP = 27.0  # mm between views at least, for dimensions and titles; a lens of 100 mm is drawn 1:1
SCALES = tuple(a * 10.0**k for k in range(4, -6, -1) for a in (5, 2, 1))
DIGITS = 1e-9  # mm on paper; what rounding coordinates to nine decimals adds
LEVEL = 10.0  # mm between a view and its dimension line
DIAMETER = "\u00d8 "  # ISO 129: before the diameter of a circle


def lens_sheet(
    lens: Lens,
    product: Product | None = None,
    chord: float = 1e-3,
    aperture: tuple[float, float] | None = None,
    flange: Flange | None = None,
    polygon: Sequence[tuple[float, float]] | None = None,
    panel: Panel | None = None,
) -> Sheet:
    """Return the drawing of a lens on an A3 sheet, at the greatest scale of ISO 5455 that it allows.

    product : names and material; None is Product().
    chord : mm, the error that curves may have; the sheet states what they keep.
    aperture : semi-axes (a, b), mm, to which the lens is cut.  flange : Flange.
    polygon : corners (x, y), mm, to which it is cut.  Sections of an outline beside the axis pass through its
        middle.  panel : to the right of the views, which makes the sheet an A3.2 (594 x 297 mm).

    Raises ValueError : as `require_sound`, `section_view`, `side_view`, `require_aperture`, `require_clear`
        and `require_polygon`; a lens that no scale puts on the sheet.
    """
    require_type("lens", lens, Lens)
    product = Product() if product is None else product
    require_type("product", product, Product)
    require_sound(lens)
    require_number("chord", chord, least=LEAST_CHORD, finite=True)
    cut = cut_lens(lens, aperture, flange, polygon)
    top, low = _views(lens, chord) if cut is None else _cut_views(cut, chord)
    scale = _scale(top, low)
    placed = _placed(top, low, scale)
    bound = float(max(view.bound for view in (*top, *low))) + DIGITS / scale
    size, paper = (PAPER, "A3") if panel is None else (WIDE, "A3.2")
    sheet = Sheet(product.name, size, scale, bound, tuple(placed))
    sheet = sheet.with_(tables(lens, product, scale, bound, cut.texts if cut else ("", ""), paper))
    if panel is not None:
        sheet = sheet.with_([*panel.marks(), *_apertures(panel, placed, chord, scale)])
    for mark in (_captions, _hatched):
        sheet = sheet.with_(mark(placed, scale))
    sheet = sheet.with_(_axes(placed, scale, (0.0, 0.0) if cut is None else cut.planes))
    if cut is None:
        return sheet.with_([*_sizes(lens, placed, scale), *_thicknesses(lens, placed, scale)])
    return sheet.with_([*_cut_sizes(cut, placed, scale), *_cut_thicknesses(cut, placed, scale)])


def _views(lens: Lens, chord: float) -> tuple[tuple[View, ...], tuple[View, ...]]:
    """Return the views of the upper and of the lower row."""
    top = (
        plan_view(lens, "front"),
        side_view(lens, "x", chord),
        section_view(lens, "x", chord=chord),
        plan_view(lens, "rear"),
    )
    return top, (side_view(lens, "y", chord), section_view(lens, "y", chord=chord))


def _cut_views(cut: CutLens, chord: float) -> tuple[tuple[View, ...], tuple[View, ...]]:
    """Return the same views of a lens that is cut to an outline."""
    top = (
        cut_plan(cut, "front", chord),
        cut_side(cut, 0, chord),
        cut_section(cut, 0, cut.planes[0], chord),
        cut_plan(cut, "rear", chord),
    )
    return top, (cut_side(cut, 1, chord), cut_section(cut, 1, cut.planes[1], chord))


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
    return placed.origin + scale * placed.view.box()


def _apertures(panel: Panel, placed: list[PlacedView], chord: float, scale: float) -> Marks:
    """Return the clear apertures of front and rear in their plans; they have two axes of symmetry."""
    rings = (ring_of(outline, chord)[0] for outline in panel.clear)
    return [
        line(*(one.origin + scale * ring), style=Style.CENTRE)
        for one, ring in zip((placed[0], placed[3]), rings)
    ]


def _captions(placed: list[PlacedView], scale: float) -> Marks:
    marks: Marks = []
    for one in placed:
        low, high = _frame(one, scale)
        drop = 10.0 if one.view.axes[1] != "y" else 23.0  # below a dimension and a section mark
        title = one.view.title.replace("SECTION x", "A-A   x").replace("SECTION y", "B-B   y")
        place = float((low[0] + high[0]) / 2), float(low[1] - drop)
        marks.append(Label(title, place, TEXT, "middle"))
    return marks


def _hatched(placed: list[PlacedView], scale: float) -> Marks:
    """Return the hatching of the pieces of sections, each within its front, rear and edges."""
    marks: Marks = []
    for one in placed:
        lines = [one.origin + scale * curve.points for curve in one.view.curves]
        for k in range(0, len(lines) if one.view.title.startswith("SECTION") else 0, 4):
            front, rear, start, stop = lines[k : k + 4]
            marks += hatching(np.concatenate([front, stop[1:-1], rear[::-1], start[-2:0:-1]]))
    return marks


def _axes(placed: list[PlacedView], scale: float, planes: tuple[float, float]) -> Marks:
    """Return the optical axis of every view, and on the rear the marks of the sections x, y = planes."""
    marks: Marks = []
    for one in placed:
        low, high = _frame(one, scale)
        x, y = one.origin
        if one.view.axes[1] == "y":
            marks.append(centre_line(np.array([low[0], y]), np.array([high[0], y])))
        if one.view.axes != ("z", "y"):
            marks.append(centre_line(np.array([x, low[1]]), np.array([x, high[1]])))
    rear = placed[3]
    (left, bottom), (right, top) = _frame(rear, scale)
    x, y = rear.origin + scale * np.array(planes)
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
        half = np.array(surface.half_width)
        marks += _width_and_height(one, scale, (-half, half))
    return marks


def _width_and_height(one: PlacedView, scale: float, box: tuple[Floats, Floats], sign: str = "") -> Marks:
    """Return the dimensions of a box in a plan, above it and to its right.

    box : the least and the greatest (right, up) of the view, mm.  sign : before the numbers.
    """
    (_, _), (right, top) = _frame(one, scale)
    low, high = (one.origin + scale * corner for corner in box)
    marks: Marks = []
    for axis, edge in ((0, top), (1, right)):
        start = high.copy()
        start[axis] = low[axis]
        level = edge + 2 * LEVEL  # clear of the section marks
        size = float(box[1][axis] - box[0][axis])
        marks += dimension(np.array([start, high]), level, axis, sign + number(size))
    return marks


def _cut_sizes(cut: CutLens, placed: list[PlacedView], scale: float) -> Marks:
    """Return width and height of the outline on the rear, and of the flange, or another rim, on the front."""
    rear = cut.shapes[1]
    marks = _width_and_height(placed[3], scale, box_of(rear), sign=DIAMETER * is_circle(rear))
    other = cut.around or (cut.shapes[0] if cut.slanted else None)
    if other is not None:
        marks += _width_and_height(placed[0], scale, box_of(other), sign=DIAMETER * is_circle(other))
    return marks


def _cut_thicknesses(cut: CutLens, placed: list[PlacedView], scale: float) -> Marks:
    """Return the thickness on the axis, where the lens has one, and at the upper edge of the section across
    x; of a flange its thickness, and where it begins behind the front vertex."""
    section, side = placed[2], placed[1]
    front, rear = (curve.points for curve in section.view.curves[-4:-2])
    marks: Marks = []
    (_, bottom), (_, top) = _frame(section, scale)
    if cut.planes[0] == 0 and any(low <= 0 <= high for low, high in intervals(cut.shape, 0, 0.0)):
        marks += _along_axis(cut.lens, section, scale, bottom - LEVEL)
    marks += _between(section, scale, front[-1], rear[-1], top + LEVEL)
    if cut.flange is not None:
        (_, bottom), (_, top) = _frame(side, scale)
        height = side.view.box()[1, 1]
        low, high = (np.array([z, height]) for z in (cut.flange.low, cut.flange.high))
        marks += _between(side, scale, low, high, top + LEVEL)
        vertex = np.array([float(cut.lens.front(0, 0)), -height])
        marks += _between(side, scale, vertex, low * [1, -1], bottom - LEVEL)
    return marks


def _along_axis(lens: Lens, section: PlacedView, scale: float, level: float) -> Marks:
    """Return the thickness on the optical axis."""
    heights = [float(lens.front(0, 0)), lens.thickness + float(lens.rear(0, 0))]
    ends = [np.array([z, 0.0]) for z in heights]
    return _between(section, scale, ends[0], ends[1], level)


def _between(one: PlacedView, scale: float, start: Floats, stop: Floats, level: float) -> Marks:
    """Return the dimension along z between two points (z, y) of a view, mm; level : on the paper."""
    ends = np.array([one.origin + scale * point for point in (start, stop)])
    return dimension(ends, level, 0, number(abs(float(stop[0] - start[0]))))


def _thicknesses(lens: Lens, placed: list[PlacedView], scale: float) -> Marks:
    """Return the thickness at the vertex and at the edge of the section x = 0, and of the whole lens."""
    section, side = placed[2], placed[1]
    front, rear = (curve.points for curve in section.view.curves[:2])
    marks: Marks = []
    (_, bottom), (_, top) = _frame(section, scale)
    marks += _along_axis(lens, section, scale, bottom - LEVEL)
    marks += _between(section, scale, front[-1], rear[-1], top + LEVEL)
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
