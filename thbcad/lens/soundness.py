"""The proof that a lens is a body: its surfaces and its ruled edges do not cross."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thbcad.checks import require_type
from thbcad.lens.edge_proof import require_simple_edges
from thbcad.lens.lens import Lens

if TYPE_CHECKING:
    from thbcad.certified import Enclosure


def require_sound(lens: Lens) -> Lens:
    """Return the lens, proven to have thickness everywhere and edges that cross neither surfaces nor each
    other.

    It is asked for where a lens comes from a problem or a file, and where it becomes a file, a solid or a
    mesh.

    Raises
    ------
    ValueError : no Lens; surfaces that touch or cross, or ruled edges that cross a surface or each other
        (with the position and the amount); an edge that comes too close for a proof; as `Lens.graphs`.
    """
    require_type("lens", lens, Lens)
    least = lens.least_thickness()
    if least.lower <= 0:
        raise ValueError(_touching(lens, least))
    require_simple_edges(lens.graphs(), lens.thickness, least.lower)
    return lens


def _touching(lens: Lens, least: Enclosure) -> str:
    """Return what is wrong with surfaces of no thickness, and where."""
    amount = abs(min(least.value, 0.0))
    ends = zip((least.u, least.v), lens.rear.half_width, "xy")
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
