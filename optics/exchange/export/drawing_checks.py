"""Drawings read back: the curves of their views against the exact surfaces of the lens."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from optics.base.runtime import Check
from optics.exchange.export.body import WHOLE, Body
from thbcad.checks import Bools, Floats
from thbcad.drawings import Sheet
from thbcad.lens import FreeformSurface, Lens
from thbcad.outlines import Outline, Polygon

SVG = "{http://www.w3.org/2000/svg}"
APPLICATION = "THBCAD"
LINES = 801  # of a surface on which an outline is looked at
ROUNDING = 1e-9  # mm: a conic as a spline, and coordinates that are moved to their place on the sheet

Drawn = tuple[str, str, str, "Floats"]  # view, curve, style, points (n, 2) in mm of the lens


def drawing_checks(lens: Lens, sheet: Sheet, path: Path, name: str, body: Body = WHOLE) -> list[Check]:
    """Return the Checks of a drawing: curves as many as drawn, sections and outlines within the bound that
    the sheet states.

    Points and middles of chords are compared: sections with the surfaces, outlines with the least z of the
    front and the greatest z of the rear on 801 lines, which they must not fall short of.

    body : to which the lens is cut
    """
    by = {"svg": "SVG read back by ElementTree", "dxf": "DXF read back by ezdxf"}[name]
    drawn, faults = _read_svg(path) if name == "svg" else _read_dxf(path)
    wanted = sum(len(one.view.curves) for one in sheet.views)
    checks = [
        Check.none_of(f"faults of the file, {by}", faults),
        Check.none_of(f"curves missing or added, {by}", abs(len(drawn) - wanted)),
    ]
    limit = sheet.bound + ROUNDING
    for word, surface, vertex in lens.faces:
        own = [curve for curve in drawn if curve[1] == word]
        section = max(_section_error(curve, surface, vertex) for curve in own if "SECTION" in curve[0])
        sign = -1 if word == "front" else 1
        outline = max(_shortfall(own, (surface, vertex, sign), axis, body, limit) for axis in (0, 1))
        checks.append(Check(f"{word} in sections, {by}", section, limit, "mm"))
        checks.append(Check(f"{word} beyond its outline, {by}", outline, limit, "mm"))
    return checks


def _read_svg(path: Path) -> tuple[list[Drawn], int]:
    """Return the curves of the views, and how many things are wrong with the units of the file."""
    root = ElementTree.parse(path).getroot()
    width, height = (root.attrib[key] for key in ("width", "height"))
    scale = float(root.attrib["data-scale"])
    corner = [float(text) for text in root.attrib["viewBox"].split()]
    drawn = []
    for item in root.iter(f"{SVG}path"):
        if "data-view" in item.attrib:
            points = np.array([pair.split() for pair in item.attrib["d"][1:].split("L")], dtype=np.float64)
            points[:, 1] = corner[3] - points[:, 1]
            origin = np.array(item.attrib["data-origin"].split(), dtype=np.float64)
            names = item.attrib["data-view"], item.attrib["data-curve"], item.attrib["class"]
            drawn.append((*names, (points - origin) / scale))
    return drawn, int((width, height) != (f"{corner[2]:g}mm", f"{corner[3]:g}mm"))


def _read_dxf(path: Path) -> tuple[list[Drawn], int]:
    """Return the curves of the views, and how many errors ezdxf's auditor finds, or a unit that is not mm."""
    import ezdxf
    from ezdxf.entities import LWPolyline

    document = ezdxf.readfile(path)
    audit = document.audit()
    drawn = []
    for item in document.modelspace().query("LWPOLYLINE"):
        if isinstance(item, LWPolyline) and item.has_xdata(APPLICATION):
            view, name, x, y = (tag.value for tag in item.get_xdata(APPLICATION))
            points = np.array(item.get_points("xy")) - [x, y]
            drawn.append((view, name, item.dxf.layer, points))
    return drawn, len(audit.errors) + len(audit.fixes) + int(document.units != ezdxf.units.MM)


def _chord_samples(points: Floats) -> Floats:
    middles = (points[:-1] + points[1:]) / 2
    return np.concatenate([points, middles])


def _section_error(curve: Drawn, surface: FreeformSurface, vertex: float) -> float:
    """Return the greatest distance in z of a section x = at or y = at from the surface."""
    view, _, _, points = curve
    samples = _chord_samples(points)
    plane = np.full(len(samples), float(view.rpartition("=")[2]))
    a, b = surface.half_width
    if view.startswith("SECTION x"):
        z, exact = samples[:, 0], surface(plane, np.clip(samples[:, 1], -b, b))
    else:
        z, exact = samples[:, 1], surface(np.clip(samples[:, 0], -a, a), plane)
    return float(np.abs(z - vertex - exact).max())


def _shortfall(
    own: list[Drawn], side: tuple[FreeformSurface, float, int], axis: int, body: Body, limit: float
) -> float:
    """Return by how much a surface at a vertex, seen along an axis, extends to +z (sign 1) or -z beyond all
    its curves in that view; of a body, whose silhouette may be steep, those nearer than a limit in y or x."""
    surface, vertex, sign = side
    seen = [points for view, _, _, points in own if view == f"SEEN FROM -{'xy'[axis]}"]
    # (y, z) of the view from -x; (x, z) of that from -y, which has -x and -z for axes
    lines = [points[:, ::-1] if axis == 0 else -points for points in seen]
    along = np.linspace(-surface.half_width[axis], surface.half_width[axis], LINES)
    across = np.unique(np.concatenate([_chord_samples(line)[:, 0] for line in lines]))
    across = across[np.abs(across) <= surface.half_width[1 - axis]]
    heights = surface.grid(*((along, across) if axis == 0 else (across, along)))
    outline = surface.outline
    inside = _within(body, outline, *((along, across) if axis == 0 else (across, along)))
    heights = np.where(inside, sign * (vertex + heights), -np.inf)
    heights = heights if axis == 0 else heights.T
    shifts = (-limit, 0.0, limit) if body.shaped or not outline.is_rectangle else (0.0,)
    curves = [_highest(line, across + shift, sign) for line in lines for shift in shifts]
    return float((heights.max(axis=0) - np.max(curves, axis=0)).max())


def _highest(line: Floats, positions: Floats, sign: int) -> Floats:
    """Return sign z of a line at positions, -infinity beside it."""
    outside = dict.fromkeys(("left", "right"), -np.inf)
    return np.interp(positions, line[:, 0], sign * line[:, 1], **outside)


def _within(body: Body, outline: Outline, x: Floats, y: Floats) -> Bools:
    """Return which positions of a grid x (n,), y (m,) lie in the outline of a body or its lens, (n, m)."""
    x, y = x[:, None], y[None, :]
    if body.aperture is not None:
        a, b = body.aperture
        return (x / a) ** 2 + (y / b) ** 2 <= 1
    shape = outline if body.polygon is None else Polygon(tuple(body.polygon))
    return shape.contains(x, y)
