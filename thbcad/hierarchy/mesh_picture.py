"""The hierarchical mesh as lines of a picture."""

import numpy as np

from thbcad.checks import Floats, Integers
from thbcad.hierarchy.hierarchical_mesh import HierarchicalMesh
from thbcad.pictures import card, frame_size, interval_text, svg
from thbcad.splines import KnotVector

CLOSEST = 3.0  # pixels: the mean distance of lines from which on a level is drawn
LONGEST_TEXT = 14_000  # characters of all lines
INK = 'fill="none" stroke="#333" stroke-width=".5" stroke-opacity=".7"'


def space_card(mesh: HierarchicalMesh, dim: int) -> str:
    """Return a picture of the mesh beside the numbers of a space, as HTML of at most 40 kB."""
    size = frame_size(*(kv.stop - kv.start for kv in (mesh.kv_u, mesh.kv_v)))
    lines, drawn = mesh_lines(mesh, *size)
    return card("THBSpace", svg(lines, *size), space_rows(mesh, dim, drawn))


def space_rows(mesh: HierarchicalMesh, dim: int, drawn: int) -> list[tuple[str, object]]:
    """Return names and numbers of a space; drawn : levels of the mesh that the picture shows."""
    shown = "" if drawn == mesh.levels else f", {drawn} of them drawn"
    return [
        ("degree", f"{mesh.kv_u.degree} x {mesh.kv_v.degree}"),
        ("levels", f"{mesh.levels}{shown}"),
        ("cells", len(mesh.cells)),
        ("degrees of freedom", dim),
        ("u", interval_text(mesh.kv_u.start, mesh.kv_u.stop)),
        ("v", interval_text(mesh.kv_v.start, mesh.kv_v.stop)),
    ]


def mesh_lines(mesh: HierarchicalMesh, width: float, height: float) -> tuple[str, int]:
    """Return the mesh as an SVG path, every line once, and how many levels it shows.

    A level is left out, and those above it, where its lines are closer than 3 pixels or their text takes more
    than 14,000 characters with that of the levels below.
    """
    text = f"M0 0H{width:g}V{height:g}H0Z"
    drawn = 0
    for level in range(mesh.levels):
        spans = [axis.spans(level) for axis in mesh.axes]
        if min(width / spans[0], height / spans[1]) < CLOSEST:
            break
        more = "".join(_level_lines(mesh, level, axis, (width, height)) for axis in (0, 1))
        if len(text) + len(more) > LONGEST_TEXT:
            break
        text += more
        drawn += 1
    return f'<path {INK} d="{text}"/>', drawn


def _level_lines(mesh: HierarchicalMesh, level: int, axis: int, size: tuple[float, float]) -> str:
    """Return the lines that a level adds across an axis: its breaks, or the middles of the refined cells."""
    across, along = (mesh.axes[d] for d in (axis, 1 - axis))
    if level == 0:
        at = np.arange(1, across.spans(0))
        low, high = np.zeros_like(at), np.full_like(at, along.spans(0))
    else:
        at, low, high = _runs(mesh.refined[level - 1][:, [axis, 1 - axis]])
        at, low, high = 2 * at + 1, 2 * low, 2 * high
    lines = [(across, at, axis), (along, low, 1 - axis), (along, high, 1 - axis)]
    ends = (_pixels(row.value(level, k), row.knot_vector, size, d) for row, k, d in lines)
    form = "M{0:.4g} {1:.4g}V{2:.4g}" if axis == 0 else "M{1:.4g} {0:.4g}H{2:.4g}"
    return "".join(form.format(*numbers) for numbers in zip(*ends))


def _pixels(values: Floats, kv: KnotVector, size: tuple[float, float], axis: int) -> Floats:
    """Return parameters as pixels, v upwards."""
    part = (values - kv.start) / (kv.stop - kv.start)
    return size[axis] * (1 - part if axis == 1 else part)


def _runs(cells: Integers) -> tuple[Integers, Integers, Integers]:
    """Return (row, first, end) of the unbroken runs of cells (row, position) in their rows."""
    rows, places = cells[np.lexsort(cells.T[::-1])].T
    new = np.append(True, (np.diff(rows) != 0) | (np.diff(places) != 1))
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(rows)) - 1
    return rows[first], places[first], places[last] + 1
