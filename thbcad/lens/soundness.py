"""The proof that a lens is a body that CAD files can hold: its surfaces and its ruled wall do not cross."""

from __future__ import annotations

from functools import lru_cache

from thbcad.certified import Enclosure, minimum
from thbcad.checks import require_type
from thbcad.lens.edge_proof import require_simple_edges
from thbcad.lens.lens import Lens
from thbcad.lens.wall_proof import require_simple_wall
from thbcad.outlines import LEAST_SIZE, Outline
from thbcad.sags import gap_graph
from thbcad.splines import BSplineSurface


def require_sound(lens: Lens) -> Lens:
    """Return the lens, proven to be at least 1e-6 mm thick everywhere, with edges that cross neither surfaces
    nor each other.

    It is asked for where a lens comes from a problem or a file, and where it becomes a file, a solid or a
    mesh.

    Raises
    ------
    ValueError : no Lens; surfaces that touch or cross, a lens below 1e-6 mm in thickness or width, or ruled
        edges that cross a surface or each other (with the position and the amount); an edge that comes too
        close for a proof; as `Lens.graphs`.
    """
    require_type("lens", lens, Lens)
    _prove(lens)
    return lens


@lru_cache(maxsize=4)
def _prove(lens: Lens) -> None:
    """A lens that is read, held against its problem and written is proven once."""
    _require(lens.graphs(), lens.thickness, lens.least_thickness(), lens.rear.outline)


def require_sound_graphs(front: BSplineSurface, rear: BSplineSurface, outline: Outline | None = None) -> None:
    """Raise ValueError as `require_sound` of the body between two graphs z(x, y).

    front, rear : scalar, of the same degrees, over rectangles around x = y = 0, mm.
    outline : of the rear, None for its rectangle; the front's is in proportion.
    """
    outline = outline or Outline((rear.kv_u.stop, rear.kv_v.stop))
    least = minimum(gap_graph(front, rear, 0.0), tolerance=1e-12, outline=outline)
    _require((front, rear), 0.0, least, outline)


def _require(
    graphs: tuple[BSplineSurface, BSplineSurface], thickness: float, least: Enclosure, outline: Outline
) -> None:
    half_widths = [(graph.kv_u.stop, graph.kv_v.stop) for graph in graphs]
    if least.lower <= 0:
        raise ValueError(_touching(outline, least))
    if least.lower < LEAST_SIZE:
        raise ValueError(
            f"at x = {least.u:.6g}, y = {least.v:.6g} mm the lens is {least.value:.3g} mm thick, less than "
            f"the {LEAST_SIZE:g} mm that CAD files can hold; raise lens.thickness"
        )
    width = 2 * min(min(pair) for pair in half_widths)
    if width < LEAST_SIZE:
        raise ValueError(
            f"the lens is {width:.3g} mm wide, less than the {LEAST_SIZE:g} mm that CAD files can hold; "
            "raise half_width"
        )
    if outline.is_rectangle:
        require_simple_edges(graphs, thickness, least.lower)
    else:
        require_simple_wall(graphs, thickness, least.lower, outline)


def _touching(outline: Outline, least: Enclosure) -> str:
    """Return what is wrong with surfaces of no thickness, and where; the outline is that of the rear."""
    amount = abs(min(least.value, 0.0))
    ends = zip((least.u, least.v), outline.half_width, "xy")
    rims = " and ".join(f"{'-+'[end > 0]}{axis}" for end, half, axis in ends if abs(end) == half)
    remedy = f"raise lens.thickness by more than {amount:.6g} mm or change the radii"
    if rims and not amount:
        return (
            f"the rims touch: at x = {least.u:.6g}, y = {least.v:.6g} mm the lens has no thickness "
            f"at its edges {rims}; {remedy}"
        )
    return (
        f"the surfaces {'cross' if amount else 'touch'}: at x = {least.u:.6g}, y = {least.v:.6g} mm"
        f" the rear lies {amount:.6g} mm before the front{f', at the edges {rims}' if rims else ''}; "
        f"{remedy}"
    )
