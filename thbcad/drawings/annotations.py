"""What stands on a sheet beside the views: dimension lines, marks of section planes, centre lines, hatching,
frame, table of the lens and title block.

Sources: ISO 5457 (margins), ISO 7200 (title block), ISO 10110-10 (table of left surface, material, right
surface).
"""

import numpy as np

from thbcad.checks import Floats
from thbcad.drawings.curves import Style
from thbcad.drawings.sheets import ARROW, SMALL, TEXT, Label, Stroke, arrowhead, line, number, rectangle
from thbcad.lens import FreeformSurface, Lens, Product

EXTENSION = (1.0, 2.0)  # mm: before and beyond an extension line
OVERHANG = 4.0  # mm of a centre line beyond the outline
MARK = 9.0  # mm of a section mark beyond the outline
SPACING = 3.0  # mm between the lines of a hatching

Marks = list[Stroke | Label]
PAPER = (420.0, 297.0)  # mm, A3
MARGINS = (20.0, 10.0)  # mm: left for binding, and all others
BAND = 44.0  # mm, height of the tables
TITLE = 160.0  # mm, width of the title block
ROW = 5.5  # mm
LONGEST = 44  # characters of a text in a cell


def dimension(points: Floats, level: float, axis: int, text: str) -> Marks:
    """Return the dimension of the distance of two points, (2, 2), along an axis of the paper.

    level : the position of the dimension line across the axis, mm.  The text stands over the line, where the
    line is too short beside it, with the arrows outside.
    """
    across = 1 - axis
    ends = []
    marks: Marks = []
    for point in points[np.argsort(points[:, axis])]:
        end = point.copy()
        end[across] = level
        sign = np.sign(level - point[across])
        unit = np.eye(2)[across] * sign
        marks.append(line(point + EXTENSION[0] * unit, end + EXTENSION[1] * unit))
        ends.append(end)
    low, high = ends
    along = np.eye(2)[axis]
    label = Label(text, (0.0, 0.0), TEXT)
    room = float(high[axis] - low[axis])
    if room > label.length + 2 * ARROW[0]:
        marks += [line(low, high), arrowhead(low, -along), arrowhead(high, along)]
        base = (low + high) / 2
        anchor = "middle"
    else:
        tail = high + (2 * ARROW[0] + label.length + 1) * along
        marks += [line(low - 2 * ARROW[0] * along, tail), arrowhead(low, along), arrowhead(high, -along)]
        base = high + 2 * ARROW[0] * along
        anchor = "start"
    base = base + (np.array([0.0, 0.8]) if axis == 0 else np.array([-0.8, 0.0]))
    marks.append(Label(text, (float(base[0]), float(base[1])), TEXT, anchor, 90.0 * axis))
    return marks


def centre_line(first: Floats, second: Floats) -> Stroke:
    """Return the centre line between two points of the outline, with its overhang."""
    unit = (second - first) / np.linalg.norm(second - first)
    return line(first - OVERHANG * unit, second + OVERHANG * unit, style=Style.CENTRE)


def section_mark(ends: Floats, sight: Floats, letter: str) -> Marks:
    """Return the marks of a section plane at both ends of its line: arrows along the sight, and a letter.

    ends : (2, 2) float, mm on the paper.  sight : (2,) float, unit vector on the paper.
    """
    first, second = ends
    unit = (second - first) / np.linalg.norm(second - first)
    marks: Marks = []
    for end, out in ((first, -unit), (second, unit)):
        inner, outer = end + OVERHANG * out, end + MARK * out
        tip = outer + 2 * ARROW[0] * sight
        marks += [line(inner, outer, style=Style.OUTLINE), line(outer, tip), arrowhead(tip, sight)]
        place = outer + out * 2.5 - np.array([0.0, TEXT / 2])
        marks.append(Label(letter, (float(place[0]), float(place[1])), TEXT, "middle"))
    return marks


def hatching(outline: Floats) -> list[Stroke]:
    """Return lines at 45 degrees inside a closed polygon (n, 2).

    Where a line crosses the polygon, it enters or leaves (even-odd rule).
    """
    turn = np.array([[1.0, -1.0], [1.0, 1.0]]) / np.sqrt(2)
    turned = outline @ turn
    start, stop = turned, np.roll(turned, -1, axis=0)
    rows = np.arange(turned[:, 1].min() + SPACING / 2, turned[:, 1].max(), SPACING)
    lines = []
    for row in rows:
        cut = (start[:, 1] <= row) != (stop[:, 1] <= row)
        a, b = start[cut], stop[cut]
        x = np.sort(a[:, 0] + (row - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0]))
        for low, high in zip(x[::2], x[1::2]):
            lines.append(line(turn @ [low, row], turn @ [high, row], style=Style.HATCH))
    return lines


def tables(
    lens: Lens, product: Product, scale: float, bound: float, outlines: tuple[str, str], paper: str
) -> Marks:
    """Return frame, table and title block; outlines : the sizes of front and rear, "" where whole."""
    left, low = MARGINS
    right, top = PAPER[0] - MARGINS[1], PAPER[1] - MARGINS[1]
    split = right - TITLE
    marks: Marks = [
        rectangle((left, low), (right, top)),
        line((left, low + BAND), (right, low + BAND), style=Style.FRAME),
        line((split, low), (split, low + BAND), style=Style.FRAME),
    ]
    width = (split - left) / 3
    material = [product.material or "material not stated"]
    if lens.index != 1:  # else the blank of a mirror
        material.append(f"n = {lens.index:.6g}")
    if product.density:
        material.append(f"density {product.density:g} g/cm3")
    columns = (_surface(lens.front, outlines[0]), material, _surface(lens.rear, outlines[1]))
    for k, (head, rows) in enumerate(zip(("FRONT", "MATERIAL", "REAR"), columns)):
        x, y = left + k * width, low + BAND - ROW
        marks.append(Label(head, (x + 2, y), TEXT))
        marks += [Label(_cut(row), (x + 2, y - (n + 1) * ROW), SMALL) for n, row in enumerate(rows)]
        if k:
            marks.append(line((x, low), (x, low + BAND), style=Style.FRAME))
    return [*marks, *_title(product, scale, bound, paper, split, low)]


def _surface(surface: FreeformSurface, outline: str) -> list[str]:
    conic = surface.conic
    base = "plane" if conic.is_plane else f"R {number(conic.radius)} mm, K {conic.constant:.6g}"
    a, b = (number(2 * h) for h in surface.half_width)
    rows = [outline or f"size {a} x {b} mm", f"base {base}"]
    if surface.sag is None:
        return [*rows, "no sag"]
    kv_u, kv_v = surface.sag.space.kv_u, surface.sag.space.kv_v
    rows.append(f"sag: spline of degree {kv_u.degree} x {kv_v.degree}")
    net = surface.graph()
    return [*rows, f"spans {net.kv_u.spans} x {net.kv_v.spans}", "exact shape: the STEP file"]


def _title(product: Product, scale: float, bound: float, paper: str, x: float, low: float) -> Marks:
    right, top = x + TITLE, low + BAND
    ratio = f"{scale:g}:1" if scale >= 1 else f"1:{1 / scale:g}"
    rows = (
        (f"curves within {rounded_up(bound)} mm of the lens", 3),
        (f"scale {ratio}    lengths in mm    {paper}", 2),
        (" / ".join(text for text in (product.author, product.organization) if text) or "thbcad", 1),
    )
    marks: Marks = [Label(_cut(product.name), (x + 3, top - 10), 5.0)]
    for text, number_ in rows:
        y = low + number_ * 7.5
        marks.append(line((x, y), (right, y), style=Style.DIMENSION))
        marks.append(Label(_cut(text, 60), (x + 3, y - 5), SMALL))
    return [*marks, *_projection_symbol(right - 29, top - 10)]


def _projection_symbol(x: float, y: float) -> Marks:
    """Return the symbol of third-angle projection, a cone seen from its small end and from the side (ISO
    5456-2)."""
    t = np.linspace(0, 2 * np.pi, 49)
    circle = np.column_stack([np.cos(t), np.sin(t)])
    centre = np.array([x, y])
    small, large = 1.75, 3.5
    cone = np.array([(7, -small), (15, -large), (15, large), (7, small), (7, -small)]) + centre
    return [
        line(*(centre + small * circle)),
        line(*(centre + large * circle)),
        line(*cone),
        line((x - 5, y), (x + 17, y), style=Style.CENTRE),
        line((x, y - 5), (x, y + 5), style=Style.CENTRE),
    ]


def rounded_up(value: float) -> str:
    """Return a positive number with two digits, not less than it."""
    if value == 0:
        return "0"
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return f"{np.ceil(value / unit) * unit:.2g}"


def _cut(text: str, most: int = LONGEST) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."
