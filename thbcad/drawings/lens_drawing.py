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
from thbcad.drawings.curves import AXES, NAMES, Style, View
from thbcad.drawings.cut_outlines import CutLens, Shape, box_of, cut_lens, intervals, is_circle, ring_of
from thbcad.drawings.cut_views import cut_plan, cut_section, cut_side
from thbcad.drawings.panels import WIDE, Panel
from thbcad.drawings.sheets import TEXT, Label, PlacedView, Sheet, Stroke, line, number
from thbcad.drawings.views import plan_view, section_view, side_view
from thbcad.lens import LEAST_CHORD, Flange, Lens, Product, require_sound

GAP = 27.0  # mm between views at least, for dimensions and titles; a lens of 100 mm is drawn 1:1
SCALES = tuple(a * 10.0**k for k in range(4, -6, -1) for a in (5, 2, 1))
DIGITS = 1e-9  # mm on paper; what rounding coordinates to nine decimals adds
LEVEL = 10.0  # mm between a view and its dimension line
# mm: width and height that views and their gaps may take
ROOM = np.array([PAPER[0] - sum(MARGINS), PAPER[1] - 2 * MARGINS[1] - BAND])
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
    top, low = _views(lens, cut, chord)
    scale = _scale(top, low)
    placed = _placed(top, low, scale)
    bound = float(max(view.bound for view in (*top, *low))) + DIGITS / scale
    size, paper = (PAPER, "A3") if panel is None else (WIDE, "A3.2")
    marks = tables(lens, product, scale, bound, cut.texts if cut else ("", ""), paper)
    if panel is not None:
        marks += [*panel.marks(), *_apertures(panel, placed, chord)]
    marks += [*_captions(placed), *_hatched(placed)]
    marks += [*_axes(placed, cut.planes if cut else (0.0, 0.0)), *_sizes(lens, cut, placed)]
    marks += _thicknesses(lens, cut, placed)
    strokes = tuple(mark for mark in marks if isinstance(mark, Stroke))
    labels = tuple(mark for mark in marks if isinstance(mark, Label))
    return Sheet(product.name, size, scale, bound, tuple(placed), strokes, labels)


def _views(lens: Lens, cut: CutLens | None, chord: float) -> tuple[tuple[View, ...], tuple[View, ...]]:
    """Return the views of the upper and of the lower row."""
    if cut is None:
        plans = [plan_view(lens, name) for name in NAMES]
        sides = [side_view(lens, axis, chord) for axis in AXES]
        sections = [section_view(lens, axis, chord=chord) for axis in AXES]
    else:
        plans = [cut_plan(cut, name, chord) for name in NAMES]
        sides = [cut_side(cut, along, chord) for along in (0, 1)]
        sections = [cut_section(cut, across, at, chord) for across, at in enumerate(cut.planes)]
    return (plans[0], sides[0], sections[0], plans[1]), (sides[1], sections[1])


def _extent(view: View) -> Floats:
    low, high = view.box()
    size: Floats = high - low
    return size


def _scale(top: tuple[View, ...], low: tuple[View, ...]) -> float:
    sizes, below = np.array([_extent(view) for view in top]), np.array([_extent(view) for view in low])
    width = sizes[:, 0].sum()
    height = sizes[:, 1].max() + below[:, 1].max()
    room = ROOM - [(len(top) + 1) * GAP, 3.2 * GAP]
    fitting = [s for s in SCALES if s * width <= room[0] and s * height <= room[1]]
    if not fitting:
        raise ValueError(f"a lens of {width:.3g} mm over all views fits at no scale on an A3 sheet")
    return max(fitting)


def _placed(top: tuple[View, ...], low: tuple[View, ...], scale: float) -> list[PlacedView]:
    """Return the views at equal gaps: the upper row with one axis y = 0, the lower below front and rear."""
    width = scale * sum(_extent(view)[0] for view in top)
    gap = (ROOM[0] - width) / (len(top) + 1)
    height = scale * (max(_extent(v)[1] for v in top) + max(_extent(v)[1] for v in low))
    upright = (ROOM[1] - height) / 3.2
    ceiling = PAPER[1] - MARGINS[1] - 1.2 * upright
    axis = ceiling - scale * max(view.box()[1, 1] for view in top)
    x = MARGINS[0] + gap
    placed = []
    for view in top:
        placed.append(PlacedView(view, np.array([x - scale * view.box()[0, 0], axis]), scale))
        x += scale * _extent(view)[0] + gap
    bottom = ceiling - scale * max(_extent(v)[1] for v in top) - upright
    for view, above in zip(low, (placed[0], placed[3])):
        origin = np.array([above.origin[0], bottom - scale * view.box()[1, 1]])
        placed.append(PlacedView(view, origin, scale))
    return placed


def _apertures(panel: Panel, placed: list[PlacedView], chord: float) -> Marks:
    """Return the clear apertures of front and rear in their plans; they have two axes of symmetry."""
    rings = (ring_of(outline, chord)[0] for outline in panel.clear)
    return [line(*one.at(ring), style=Style.CENTRE) for one, ring in zip((placed[0], placed[3]), rings)]


def _captions(placed: list[PlacedView]) -> Marks:
    marks: Marks = []
    for one in placed:
        low, high = one.frame
        drop = 10.0 if one.view.axes[1] != "y" else 23.0  # below a dimension and a section mark
        title = one.view.title.replace("SECTION x", "A-A   x").replace("SECTION y", "B-B   y")
        place = float((low[0] + high[0]) / 2), float(low[1] - drop)
        marks.append(Label(title, place, TEXT, "middle"))
    return marks


def _hatched(placed: list[PlacedView]) -> Marks:
    """Return the hatching of the pieces of sections, each within its front, rear and edges."""
    marks: Marks = []
    for one in placed:
        lines = [one.at(curve.points) for curve in one.view.curves]
        for k in range(0, len(lines) if one.view.title.startswith("SECTION") else 0, 4):
            front, rear, start, stop = lines[k : k + 4]
            marks += hatching(np.concatenate([front, stop[1:-1], rear[::-1], start[-2:0:-1]]))
    return marks


def _axes(placed: list[PlacedView], planes: tuple[float, float]) -> Marks:
    """Return the optical axis of every view, and on the rear the marks of the sections x, y = planes."""
    marks: Marks = []
    for one in placed:
        low, high = one.frame
        x, y = one.origin
        if one.view.axes[1] == "y":
            marks.append(centre_line(np.array([low[0], y]), np.array([high[0], y])))
        if one.view.axes != ("z", "y"):
            marks.append(centre_line(np.array([x, low[1]]), np.array([x, high[1]])))
    rear = placed[3]
    (left, bottom), (right, top) = rear.frame
    x, y = rear.at(np.array(planes))
    upright, level = np.array([(x, bottom), (x, top)]), np.array([(left, y), (right, y)])
    marks += section_mark(upright, np.array([1.0, 0.0]), "A")
    return [*marks, *section_mark(level, np.array([0.0, 1.0]), "B")]


def _sizes(lens: Lens, cut: CutLens | None, placed: list[PlacedView]) -> Marks:
    """Return width and height of the outline on the rear, and of the flange, or another rim, on the front."""
    differ = lens.front.half_width != lens.rear.half_width
    rear: Shape = lens.rear.outline
    other: Shape | None = lens.front.outline if differ else None
    if cut is not None:
        rear, other = cut.shapes[1], cut.around or (cut.shapes[0] if cut.slanted else None)
    marks = _width_and_height(placed[3], rear)
    return marks if other is None else [*marks, *_width_and_height(placed[0], other)]


def _width_and_height(one: PlacedView, shape: Shape) -> Marks:
    """Return the dimensions of an outline in a plan, above it and to its right."""
    (_, _), (right, top) = one.frame
    box = box_of(shape)
    low, high = (one.at(corner) for corner in box)
    marks: Marks = []
    for axis, edge in ((0, top), (1, right)):
        start = high.copy()
        start[axis] = low[axis]
        level = edge + 2 * LEVEL  # clear of the section marks
        text = DIAMETER * is_circle(shape) + number(float(box[1][axis] - box[0][axis]))
        marks += dimension(np.array([start, high]), level, axis, text)
    return marks


def _thicknesses(lens: Lens, cut: CutLens | None, placed: list[PlacedView]) -> Marks:
    """Return the thickness on the axis, where the lens has one, at the upper edge of the section across x,
    and over all; of a flange its thickness, and where it begins behind the front vertex."""
    section, side = placed[2], placed[1]
    front, rear = (curve.points for curve in section.view.curves[-4:-2])
    marks: Marks = []
    (_, bottom), (_, top) = section.frame
    if cut is None or _has_axis(cut):
        ends = np.array([(float(lens.front(0, 0)), 0.0), (lens.thickness + float(lens.rear(0, 0)), 0.0)])
        marks += _between(section, ends[0], ends[1], bottom - LEVEL)
    marks += _between(section, front[-1], rear[-1], top + LEVEL)
    (left, bottom), (right, top) = side.frame
    low, high = side.view.box()
    if cut is None:
        ends = np.array([(left, bottom), (right, bottom)])
        lowest, highest = (value_range(graph)[k].value for k, graph in enumerate(lens.graphs()))
        marks += dimension(ends, bottom - LEVEL, 0, number(lens.thickness + highest - lowest))
    elif cut.flange is None:
        marks += _between(side, low, np.array([high[0], low[1]]), bottom - LEVEL)
    else:
        marks += _between(side, np.array([low[0], high[1]]), high, top + 2 * LEVEL)
        begin, end = (np.array([z, high[1]]) for z in (cut.flange.low, cut.flange.high))
        marks += _between(side, begin, end, top + LEVEL)
        vertex = np.array([float(lens.front(0, 0)), -high[1]])
        marks += _between(side, vertex, begin * [1, -1], bottom - LEVEL)
    return marks


def _has_axis(cut: CutLens) -> bool:
    """Return whether the section across x shows the optical axis within the lens."""
    return cut.planes[0] == 0 and any(low <= 0 <= high for low, high in intervals(cut.shape, 0, 0.0))


def _between(one: PlacedView, start: Floats, stop: Floats, level: float) -> Marks:
    """Return the dimension along z between two points (z, y) of a view, mm; level : on the paper."""
    ends = np.array([one.at(point) for point in (start, stop)])
    return dimension(ends, level, 0, number(abs(float(stop[0] - start[0]))))


def strokes_of_views(sheet: Sheet) -> list[tuple[PlacedView, str, Stroke]]:
    """Return (view, name, stroke) of every curve of the views on the paper, hidden lines first."""
    strokes = [
        (one, curve.name, Stroke(one.at(curve.points), curve.style))
        for one in sheet.views
        for curve in one.view.curves
    ]
    return sorted(strokes, key=lambda item: item[2].style is not Style.HIDDEN)
