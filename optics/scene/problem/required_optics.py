"""What keys of elements and stops must go together: free surfaces, glass, outlines, apertures, bodies."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from optics.base.runtime import UserError, require_file_name
from optics.scene.keys import AUTO, Rows
from optics.scene.problem.elements import MirrorElement, Placed
from optics.scene.problem.lens_schema import LensSpec, Optic
from optics.scene.problem.target_schema import StopSpec

LEAST_INDEX = 1.000001  # of lens.indices: that of lens.index must be greater than 1


def require_optic(optic: Optic, shaped: bool) -> None:
    """Refuse an element whose keys do not go together.  shaped : a transport map shapes a surface of it.

    Raises UserError : names the key.
    """
    if isinstance(optic, LensSpec):
        _require_glass(optic)
    if shaped:
        _require_base(optic)
    else:
        _require_numbers(optic)
    _require_outline(optic)
    _require_clear_aperture(optic)
    _require_body(optic)
    _require_array(optic)


def require_stops(stops: Sequence[StopSpec]) -> None:
    """Refuse a ring without a middle.

    Raises UserError : names the key.
    """
    for k, stop in enumerate(stops):
        key = f"stop[{k}]"
        if stop.shape == "ring" and not all(0 < i < o for i, o in zip(stop.inner, stop.half_width)):
            raise UserError(
                f"{key}.inner must be above 0 and below {key}.half_width = {list(stop.half_width)} in x and "
                f"y, got {list(stop.inner)}"
            )


def require_named_elements(elements: Sequence[Placed]) -> None:
    """Refuse elements without a name for a file, and those of a row with that of another file of a result.

    Some file systems take names that differ only in case for one.

    Raises UserError : names the table.
    """
    for k, element in enumerate(elements):
        if not element.name:
            raise UserError(f'element[{k}].name is missing; add one, such as name = "M1"')
        require_file_name(f"element[{k}].name =", element.name, 'take another, such as "L1"')
        if len(elements) > 1 and element.name.lower() in ("lens", "scene"):
            raise UserError(
                f"element[{k}].name = {element.name!r} is that of a file of the result, {element.name}.step; "
                'take another, such as "L1"'
            )
        if alike := [e.name for e in elements[:k] if e.name.lower() == element.name.lower()]:
            raise UserError(
                f"element[{k}].name = {element.name!r} differs from {alike[0]!r} only in case, and both name "
                "files; take another"
            )


def _require_glass(lens: LensSpec) -> None:
    """Refuse a lens of which nobody knows the index."""
    if lens.index == AUTO and not (lens.indices or lens.material):
        raise UserError(
            f"the key {lens.key('index')} is missing (refractive index, relative to the air around); add it, "
            f'or name a known material, such as {lens.key("material")} = "PMMA"'
        )
    require_rows(lens.key("indices"), lens.indices, LEAST_INDEX, 10.0)
    require_rows(lens.key("absorptions"), lens.absorptions, 0.0, 1e3)


def require_free(optic: Optic) -> None:
    """Refuse an element without a surface to design.

    Raises UserError : names the key.
    """
    if not optic.free:
        mirror = isinstance(optic, MirrorElement)
        fixed = optic.key("front.freeform" if mirror else "rear.freeform")
        remedy = "leave it out" if mirror else f"add the table {optic.key('front.freeform')}"
        raise UserError(
            f"{fixed} = false leaves no surface to design; {remedy}, or trace it as it is by `thbcad trace`"
        )


def _require_base(optic: Optic) -> None:
    """Refuse a fixed rear whose base is left to the program."""
    if optic.rear.freeform is None and AUTO in (optic.rear.radius, optic.rear.conic):
        raise UserError(
            f"{optic.key('rear.radius')} and {optic.key('rear.conic')} must be numbers with "
            f'{optic.key("rear.freeform")} = false, got "{AUTO}"'
        )


def require_rows(key: str, rows: Rows, low: float, high: float) -> None:
    """Refuse rows (nm, value) out of their limits, and wavelengths that come twice.

    Raises UserError : names the row.
    """
    for k, (nm, value) in enumerate(rows):
        if not 1 <= nm <= 1e6:
            raise UserError(f"{key}[{k}][0] must be a wavelength from 1 to 1e+06 nm, got {nm:g}")
        if not low <= value <= high:
            raise UserError(f"{key}[{k}][1] must be from {low:.7g} to {high:g}, got {value:g}")
    wavelengths = sorted(nm for nm, _ in rows)
    for nm, following in pairwise(wavelengths):
        if nm == following:
            raise UserError(f"{key} has several rows for {nm:g} nm; keep one")


def _require_numbers(optic: Optic) -> None:
    """Refuse a base or a bound that is left to the program where no transport map tells it."""
    for name, surface in (("front", optic.front), ("rear", optic.rear)):
        if AUTO in (surface.radius, surface.conic):
            raise UserError(
                f"{optic.key(name)}.radius and {optic.key(name)}.conic must be numbers, since only the last "
                f'free surface of the path gets them from the light; got "{AUTO}"'
            )
        if surface.freeform is not None and surface.freeform.z_freedom == AUTO:
            raise UserError(
                f"{optic.key(name)}.freeform.z_freedom must be a number of mm, since only the last free "
                f'surface of the path gets it from the light; got "{AUTO}"'
            )


def _require_outline(lens: Optic) -> None:
    """Refuse an outline that the half-widths cannot have."""
    sizes = {"front": lens.front.half_width, "rear": lens.rear.half_width}
    for name, (x, y) in sizes.items():
        if lens.outline == "round" and x != y:
            raise UserError(
                f'{lens.key("outline")} = "round" needs equal half-widths, got '
                f'{lens.key(name)}.half_width = [{x:g}, {y:g}]; make them equal, or take "ellipse"'
            )
    if lens.outline == "rounded" and not lens.corner_radius:
        raise UserError(
            f'the key {lens.key("corner_radius")} is missing (mm, of {lens.key("outline")} = "rounded"); '
            "add it"
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


def _require_array(lens: Optic) -> None:
    """Refuse a plate of lenses that touch, or of lenses that are no plain rectangles on the axis."""
    array, key = lens.array, lens.key("array")
    if array is None:
        return
    if lens.table != "lens":
        raise UserError(f"{key} is that of a lens on the axis: take [lens] in place of [[element]]")
    if len(array.pitch) > 2:
        raise UserError(
            f"{key}.pitch must be one number, or those of x and y, got {list(array.pitch)}; leave others out"
        )
    for axis, pitch, *halves in zip("xy", array.pitches, lens.front.half_width, lens.rear.half_width):
        if pitch <= 2 * max(halves):
            raise UserError(
                f"{key}.pitch must be greater than the lens is wide, {2 * max(halves):g} mm in {axis}, so "
                f"that there is land between the lenses; got {pitch:g}"
            )
    for name, plain in (("outline", lens.outline == "rectangle"), ("body", lens.body is None)):
        if not plain:
            raise UserError(
                f"{key} joins rectangular lenses with their own walls: leave out {lens.key(name)}, or it"
            )
    if lens.coats != (None, None):
        raise UserError(
            f"{key} is followed through bare glass alone: leave out the reflectance of front and rear"
        )
    if any(lens.clear_aperture):
        raise UserError(f"{key} has no holder round each lens: leave out {lens.key('clear_aperture')}")
