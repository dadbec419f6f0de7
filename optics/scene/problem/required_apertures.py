"""What the lens leaves free of light, and what stops do: keys that must go together."""

from __future__ import annotations

from collections.abc import Sequence

from optics.base.runtime import UserError
from optics.scene.problem.lens_schema import Optic
from optics.scene.problem.schema import StopSpec
from optics.scene.problem.toml_records import AUTO


def require_apertures(lens: Optic, stops: Sequence[StopSpec]) -> None:
    """Refuse an outline that the half-widths cannot have, a clear aperture and stops that make no sense.

    Raises
    ------
    UserError : names the key.
    """
    _require_outline(lens)
    _require_clear_aperture(lens)
    _require_body(lens)
    for k, stop in enumerate(stops):
        _require_stop(f"stop[{k}]", stop)


def _require_outline(lens: Optic) -> None:
    """Refuse an outline that the half-widths cannot have."""
    sizes = {"front": lens.front.half_width, "rear": lens.rear.half_width}
    for name, (x, y) in sizes.items():
        if lens.outline == "round" and x != y:
            raise UserError(
                f'{lens.key("outline")} = "round" needs equal half-widths, got '
                f'{lens.key(name)}.half_width = [{x:g}, {y:g}]; make them equal, or take "ellipse"'
            )
    if (lens.outline == "rounded") != (lens.corner_radius > 0):
        raise UserError(
            f'{lens.key("corner_radius")} is that of {lens.key("outline")} = "rounded", which needs one '
            f"above 0; got {lens.corner_radius:g} with {lens.outline!r}"
        )
    most = min(max(pair) for pair in zip(*sizes.values()))
    if lens.corner_radius > most:
        raise UserError(
            f"{lens.key('corner_radius')} must be at most {most:g} mm, the least half-width of the larger "
            f"surface, got {lens.corner_radius:g}"
        )


def _require_clear_aperture(lens: Optic) -> None:
    """Refuse a clear aperture that leaves nothing, or more than there is."""
    clear = lens.clear_aperture
    if (min(clear) == 0) != (max(clear) == 0):
        raise UserError(
            f"{lens.key('clear_aperture')} = {list(clear)} leaves nothing of the lens; give two half-widths "
            "above 0, or [0, 0] for all of it"
        )
    most = [max(pair) for pair in zip(lens.front.half_width, lens.rear.half_width)]
    if any(c > m for c, m in zip(clear, most)):
        raise UserError(
            f"{lens.key('clear_aperture')} must lie within front and rear, at most {most}, got {list(clear)}"
        )


def _require_body(lens: Optic) -> None:
    """Refuse a body whose keys do not go together, or not with the outlines of the lens."""
    body = lens.body
    if body is None:
        return
    alike = lens.front.half_width == lens.rear.half_width
    if alike and body.annulus:
        raise UserError(
            f"{lens.key('body.annulus')} joins a smaller surface to the outline of a larger, and "
            "front and rear have one half_width; leave it out"
        )
    if not alike and not body.annulus:
        raise UserError(
            f"{lens.key('body')} is that of front and rear of one half_width, or of unlike ones with "
            "annulus = true; add it"
        )
    if body.land != AUTO and not body.annulus:
        raise UserError(f"{lens.key('body.land')} is that of {lens.key('body.annulus')} = true; leave it out")
    if body.draft and lens.outline == "ellipse":
        raise UserError(
            f'{lens.key("body.draft")} needs {lens.key("outline")} = "rectangle", "round" or '
            '"rounded", got "ellipse"'
        )
    if body.edge_radius and lens.outline == "rectangle":
        raise UserError(
            f"{lens.key('body.edge_radius')} needs an outline without sharp corners; take "
            f'{lens.key("outline")} = "rounded"'
        )


def _require_stop(key: str, stop: StopSpec) -> None:
    """Refuse a ring without a middle, and a middle without a ring."""
    ring = stop.shape == "ring"
    if ring and not all(0 < i < o for i, o in zip(stop.inner, stop.half_width)):
        raise UserError(
            f"{key}.inner must be above 0 and below {key}.half_width = {list(stop.half_width)} in x and y, "
            f"got {list(stop.inner)}"
        )
    if not ring and any(stop.inner):
        raise UserError(f'{key}.inner is that of shape = "ring", got {list(stop.inner)} with {stop.shape!r}')
