"""Drawings read back: the curves of their views against the exact surfaces of the lens."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from optics.runtime import Check

if TYPE_CHECKING:
    from thbcad.checks import Floats
    from thbcad.drawings import Sheet
    from thbcad.lens import FreeformSurface, Lens

SVG = "{http://www.w3.org/2000/svg}"
APPLICATION = "THBCAD"
LINES = 801  # of a surface on which an outline is looked at
ROUNDING = 1e-9  # mm: a conic as a spline, and coordinates that are moved to their place on the sheet

Drawn = tuple[str, str, str, "Floats"]  # view, curve, style, points (n, 2) in mm of the lens


def drawing_checks(lens: Lens, sheet: Sheet, path: Path, name: str) -> list[Check]:
    """Return the Checks of a drawing: curves as many as drawn, sections and outlines within the bound that
    the sheet states.

    Points and middles of chords are compared: sections with the surfaces, outlines with the least z of the
    front and the greatest z of the rear on 801 lines, which they must not fall short of.
    """
    by = {"svg": "SVG read back by ElementTree", "dxf": "DXF read back by ezdxf"}[name]
    drawn, faults = _read_svg(path) if name == "svg" else _read_dxf(path)
    wanted = sum(len(one.view.curves) for one in sheet.views)
    checks = [
        Check(f"faults of the file, {by}", faults, 0, ""),
        Check(f"curves missing or added, {by}", abs(len(drawn) - wanted), 0, ""),
    ]
    limit = sheet.bound + ROUNDING
    surfaces = {"front": (lens.front, 0.0), "rear": (lens.rear, lens.thickness)}
    for word, (surface, vertex) in surfaces.items():
        own = [curve for curve in drawn if curve[1] == word]
        section = max(_section_error(curve, surface, vertex) for curve in own if "SECTION" in curve[0])
        sign = -1 if word == "front" else 1
        outline = max(_shortfall(own, surface, vertex, axis, sign) for axis in (0, 1))
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
    samples: Floats = np.concatenate([points, middles])
    return samples


def _section_error(curve: Drawn, surface: FreeformSurface, vertex: float) -> float:
    """Return the greatest distance in z of a section x = 0 or y = 0 from the surface."""
    view, _, _, points = curve
    samples = _chord_samples(points)
    zero = np.zeros(len(samples))
    if view.startswith("SECTION x"):
        z, exact = samples[:, 0], surface(zero, samples[:, 1])
    else:
        z, exact = samples[:, 1], surface(samples[:, 0], zero)
    return float(np.abs(z - vertex - exact).max())


def _shortfall(own: list[Drawn], surface: FreeformSurface, vertex: float, axis: int, sign: int) -> float:
    """Return by how much the surface, seen along an axis, extends to +z (sign 1) or -z beyond all its curves
    in that view."""
    lines = [_height_line(points, axis) for view, _, _, points in own if view == f"SEEN FROM -{'xy'[axis]}"]
    along = np.linspace(-surface.half_width[axis], surface.half_width[axis], LINES)
    across = np.unique(np.concatenate([_chord_samples(line)[:, 0] for line in lines]))
    across = across[np.abs(across) <= surface.half_width[1 - axis]]
    heights = surface.grid(*((along, across) if axis == 0 else (across, along)))
    heights = sign * (vertex + (heights if axis == 0 else heights.T))
    curves = sign * np.array([np.interp(across, *line.T) for line in lines])
    return float((heights.max(axis=0) - curves.max(axis=0)).max())


def _height_line(points: Floats, axis: int) -> Floats:
    """Return points (y, z) of a view along x, (x, z) of one along y."""
    line: Floats = points[:, ::-1] if axis == 0 else points
    return line
