"""What is proven of a moulded body: its parting line, its land, the glass between its surfaces, its rounded
edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from thbcad.certified import minimum, value_range
from thbcad.lens import require_sound, segment
from thbcad.moulds.body_shape import BodyShape
from thbcad.moulds.body_walls import least_support
from thbcad.moulds.inserts import FACES
from thbcad.outlines import LEAST_SIZE
from thbcad.sags import gap_graph

LEAST_RADIUS = 0.01  # mm, below which no fitting radius is looked for
HALVINGS = 6  # of the interval that holds the largest fitting radius: to 2 %


def require_parting(body: BodyShape) -> None:
    """Raise ValueError where the parting line is not proven to lie between both ends of the walls."""
    for k, word in enumerate(FACES):
        side = 2 * k - 1
        if body.small == k and body.inner is not None:
            beyond, place = side * (body.inner.level - body.parting), "land"
            least = 0.0
        else:
            heights = body.feet[k].heights
            beyond, place = side * (heights[1 - k] - body.parting), f"{word}'s rim"
            least = LEAST_SIZE
        for z in body.feet[k].heights:
            body.wall(k).at(z)  # something is left of its corners
        if beyond < least:
            raise ValueError(
                f"the parting line at z = {body.parting:.9g} mm must lie {'below' if k else 'above'} the "
                f"{place}, which reaches z = {body.parting + side * beyond:.9g} mm; change "
                "lens.body.parting"
            )


def require_glass(body: BodyShape) -> None:
    """Raise ValueError where the surfaces, or the land and the larger one, are not proven apart."""
    lens, small = body.lens, body.small
    if body.inner is None or small is None:
        require_sound(lens)
        return
    side, land = body.inner.side, body.inner.level
    if body.stepped and min(side * (z - land) for z in body.feet[small].heights) < LEAST_SIZE:
        raise ValueError(
            f"the land at z = {land:.9g} mm meets the drafted rim of the {FACES[small]}; change "
            "lens.body.land"
        )
    width = least_support(body.walls[small].at(land), body.inner.outline)
    if width < LEAST_SIZE:
        raise ValueError(
            f"the land at z = {land:.9g} mm has no width: the drafted wall leaves {width:.3g} mm round "
            f"the {FACES[small]}; make lens.body.draft smaller"
        )
    graphs = list(lens.graphs())
    half = list((lens.front, lens.rear)[small].half_width)
    graphs[1 - small] = segment(graphs[1 - small], half)
    least = minimum(gap_graph(graphs[0], graphs[1], lens.thickness))
    if least.lower < LEAST_SIZE:
        raise ValueError(
            f"at x = {least.u:.6g}, y = {least.v:.6g} mm front and rear are {least.value:.6g} mm apart; "
            "raise lens.thickness"
        )
    other = value_range(lens.graphs()[1 - small], outline=body.outline)
    nearest = lens.thickness + other[0].lower if small == 0 else other[1].upper
    room = (nearest - body.inner.level) * (1 if small == 0 else -1)
    if room < LEAST_SIZE:
        raise ValueError(
            f"the land at z = {body.inner.level:.9g} mm must lie outside of the {FACES[1 - small]}, "
            f"which reaches z = {nearest:.9g} mm; raise lens.thickness or change lens.body.annulus"
        )


def require_radius(body: BodyShape) -> None:
    """Raise ValueError where a rounded edge does not fit between its rim and the next edge."""
    if body.outline.is_rectangle:
        raise ValueError(
            "lens.body.edge_radius needs an outline without sharp corners, round which no ball rolls: take "
            'lens.outline = "rounded" or edge_radius 0'
        )
    unfit = _unfit(body)
    if not unfit:
        return
    largest = _largest_radius(body)
    advice = f"take {largest:g} mm, which fits" if largest else "make the wall higher, or take 0"
    raise ValueError(f"lens.body.edge_radius = {body.edge_radius:g} mm is too large: {unfit}; {advice}")


def _largest_radius(body: BodyShape) -> float:
    """Return about the largest edge radius that fits, mm, with two digits; 0 where none is found.

    It is halved until it fits, then found between a radius that fits and one that does not by bisection.
    """

    def fits(radius: float) -> bool:
        return not _unfit(replace(body, edge_radius=radius))

    high = min(body.edge_radius, max(body.outline.half_width))  # no ball within the wall is larger
    low = high
    while not fits(low):
        low, high = low / 2, low
        if low < LEAST_RADIUS:
            return 0.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    step = 10.0 ** (np.floor(np.log10(low)) - 1)
    radius = float(f"{np.floor(low / step) * step:.2g}")
    return radius if fits(radius) else 0.0


def _unfit(body: BodyShape) -> str:
    """Return why edges cannot be rounded, "" where they can."""
    for k in body.rounded:
        try:
            reached = body.rounded_edges[k].on_wall.heights[1 - k]
        except ValueError as error:
            return f"at the {FACES[k]} {error}"
        side = 2 * k - 1
        if body.walls[k].draft:
            end, place = body.parting, "the parting line"
        elif 1 - k in body.rounded:
            end, place = (
                body.rounded_edges[1 - k].on_wall.heights[k],
                f"the rounding of the {FACES[1 - k]}",
            )
        elif body.inner is not None:
            end, place = body.inner.level, "the land"
        else:
            end, place = body.feet[1 - k].heights[k], f"the rim of the {FACES[1 - k]}"
        if side * (reached - end) < LEAST_SIZE:
            return (
                f"on the wall the rounding of the {FACES[k]} ends at z = {reached:.6g} mm, beyond {place} "
                f"at z = {end:.6g} mm"
            )
    return ""
