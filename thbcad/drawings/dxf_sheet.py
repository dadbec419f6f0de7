"""A sheet as DXF (AutoCAD 2010), the lens at its true size in mm; the same sheet gives the same bytes."""

import io

import ezdxf
from ezdxf import units
from ezdxf.document import Drawing
from ezdxf.entities import DXFGraphic
from ezdxf.enums import TextEntityAlignment
from ezdxf.layouts import Modelspace
from ezdxf.sections.classes import REQ_R2004

from thbcad.drawings.curves import Style
from thbcad.drawings.lens_drawing import strokes_of_views
from thbcad.drawings.sheets import Sheet, Stroke
from thbcad.drawings.svg_sheet import DASHES, WIDTHS

APPLICATION = "THBCAD"  # of the extended data: view, curve, and where the view has its point (0, 0)
TEXTS = "TEXT"
CLASSES = (*REQ_R2004, "ACDBPLACEHOLDER", "LAYOUT")  # ezdxf itself adds the last two as a set orders them
COLOURS = {Style.OUTLINE: 7, Style.HIDDEN: 8, Style.CENTRE: 1, Style.HATCH: 8, Style.DIMENSION: 5}
WHITE = 7  # shown black on white
ALIGNMENTS = {
    "start": TextEntityAlignment.LEFT,
    "middle": TextEntityAlignment.CENTER,
    "end": TextEntityAlignment.RIGHT,
}
MAXIMA = "$EXTMIN", "$EXTMAX"


def dxf_bytes(sheet: Sheet) -> bytes:
    """Return a sheet as a DXF file in mm: the lens 1:1, paper sizes divided by the scale.

    Curves of the views carry extended data of the application THBCAD: title of the view, name of the curve,
    and x and y of the view's point (0, 0).
    """
    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True  # fixed times and identifiers
    try:
        return _text(sheet)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def _text(sheet: Sheet) -> bytes:
    document = ezdxf.new("R2010", units=units.MM)
    for kind in CLASSES:
        document.classes.add_class(kind)
    document.appids.add(APPLICATION)
    _add_layers(document, 1 / sheet.scale)
    space = document.modelspace()
    for stroke in sheet.strokes:
        _add_stroke(space, stroke, sheet.scale)
    for view, name, stroke in strokes_of_views(sheet):
        entity = _add_stroke(space, stroke, sheet.scale)
        x, y = (view.origin / sheet.scale).tolist()
        entity.set_xdata(APPLICATION, [(1000, view.view.title), (1000, name), (1040, x), (1040, y)])
    for label in sheet.labels:
        text = space.add_text(
            label.text, height=label.height / sheet.scale, rotation=label.angle, dxfattribs={"layer": TEXTS}
        )
        x, y = label.position
        text.set_placement((x / sheet.scale, y / sheet.scale), align=ALIGNMENTS[label.anchor])
    for name, corner in zip(MAXIMA, ((0.0, 0.0), sheet.size)):
        document.header[name] = (corner[0] / sheet.scale, corner[1] / sheet.scale, 0.0)
    whole = io.StringIO()
    document.write(whole)
    return whole.getvalue().encode(document.output_encoding)


def _add_layers(document: Drawing, size: float) -> None:
    """Add the layers with their line types; size : mm of the lens per mm on paper."""
    for style, dashes in DASHES.items():
        signed = [length * size * (-1) ** k for k, length in enumerate(dashes)]
        document.linetypes.add(style.value, [sum(dashes) * size, *signed], description=style.value.lower())
    for style in Style:
        layer = document.layers.add(style.value, color=COLOURS.get(style, WHITE))
        layer.dxf.linetype = style.value if style in DASHES else "Continuous"
        layer.dxf.lineweight = round(100 * WIDTHS[style])
    document.layers.add(TEXTS, color=WHITE)


def _add_stroke(space: Modelspace, stroke: Stroke, scale: float) -> DXFGraphic:
    points = (stroke.points / scale).tolist()
    attributes = {"layer": stroke.style.value}
    if stroke.filled:
        return space.add_solid(points[:3], dxfattribs=attributes)
    return space.add_lwpolyline(points, dxfattribs=attributes)
