"""A sheet as SVG: user units are mm on paper, coordinates have nine decimals; the same sheet gives the same
bytes."""

from xml.sax.saxutils import escape, quoteattr

from thbcad.drawings.annotations import rounded_up
from thbcad.drawings.curves import Style
from thbcad.drawings.lens_drawing import strokes_of_views
from thbcad.drawings.sheets import Label, Sheet, Stroke

WIDTHS = {  # mm (ISO 128-20)
    Style.OUTLINE: 0.5,
    Style.HIDDEN: 0.25,
    Style.CENTRE: 0.18,
    Style.HATCH: 0.13,
    Style.DIMENSION: 0.18,
    Style.FRAME: 0.5,
}
DASHES = {Style.HIDDEN: (2.5, 1.25), Style.CENTRE: (8.0, 1.5, 0.5, 1.5)}  # mm: line, gap, ...
CAPITALS = 0.72  # of the font size: the height of capitals in common fonts
FONTS = "osifont, Arial, Helvetica, sans-serif"


def svg_bytes(sheet: Sheet) -> bytes:
    """Return a sheet as an SVG file in mm.

    Curves of the views are `path` elements with the attributes data-view and data-curve; data-origin of the
    view's group is the position of its point (0, 0), in mm from the lower left corner.
    """
    width, height = sheet.size
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}" data-scale="{sheet.scale:.12g}" '
        f'data-bound-mm="{sheet.bound!r}">\n'
        f"<title>{escape(sheet.name)}</title>\n"
        f"<desc>Lengths in mm. Curves of the views lie within {rounded_up(sheet.bound)} mm of the lens."
        "</desc>\n"
        f'<rect width="{width:g}" height="{height:g}" fill="#fff"/>\n'
        '<g fill="none" stroke="#000" stroke-linejoin="round">\n'
    ]
    parts += [_path(stroke, height) for stroke in sheet.strokes]
    for view, name, stroke in strokes_of_views(sheet):
        x, y = view.origin
        marks = (
            f" data-view={quoteattr(view.view.title)} data-curve={quoteattr(name)} "
            f'data-origin="{_number(x)} {_number(y)}"'
        )
        parts.append(_path(stroke, height, marks))
    parts.append(f'</g>\n<g font-family="{FONTS}" fill="#000">\n')
    parts += [_text(label, height) for label in sheet.labels]
    parts.append("</g>\n</svg>\n")
    return "".join(parts).encode()


def _number(value: float) -> str:
    return f"{value + 0.0:.9f}".rstrip("0").rstrip(".")


def _path(stroke: Stroke, height: float, marks: str = "") -> str:
    dashes = DASHES.get(stroke.style)
    dashed = f' stroke-dasharray="{" ".join(map(str, dashes))}"' if dashes else ""
    fill = ' fill="#000"' if stroke.filled else ""
    line = "M" + "L".join(f"{_number(x)} {_number(height - y)}" for x, y in stroke.points)
    return (
        f'<path class="{stroke.style}" stroke-width="{WIDTHS[stroke.style]}"{dashed}{fill}{marks} '
        f'd="{line}"/>\n'
    )


def _text(label: Label, height: float) -> str:
    x, y = label.position[0], height - label.position[1]
    turn = f' transform="rotate({-label.angle:g} {_number(x)} {_number(y)})"' if label.angle else ""
    return (
        f'<text x="{_number(x)}" y="{_number(y)}" font-size="{label.height / CAPITALS:.4g}" '
        f'text-anchor="{label.anchor}"{turn}>{escape(label.text)}</text>\n'
    )
