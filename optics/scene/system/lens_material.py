"""What lenses are made of: their index and absorption at every wavelength that is traced."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from optics.base.runtime import UserError
from optics.scene.keys import AUTO
from optics.scene.materials import Material, find_material, tabulated
from optics.scene.paths import AIR, Medium
from optics.scene.photometry import spectral_lines
from optics.scene.problem import Optic, Problem, Source

INDEX_DIGITS = 6  # behind the point: no index is known better
ABSORPTION_DIGITS = 4
VISIBLE = range(380, 781, 20)  # nm, at which absorption is tabulated for other light that may come later
SAME_INDEX = 1e-3  # tolerated where a material's accuracy is unknown or finer
SAME_ABSORPTION = 1e-2  # relative
CAUCHY = -2  # power of the wavelength in which indices are interpolated


@dataclass(frozen=True)
class Wavelength:
    """Light of one wavelength.

    nm : in air.  weight : of the source's flux.  media : of the path, see `LightPath`.
    xyz : CIE 1931 colour of a watt, in units of 683 lm/W, or of a lumen, with Y = 1, as `source.unit` has it;
        None where no spectrum is given.
    """

    nm: float
    weight: float
    media: tuple[Medium, ...]
    xyz: tuple[float, float, float] | None = None


def with_material(problem: Problem) -> Problem:
    """Return the problem with numbers for what it leaves to materials: index, density, absorption.

    Raises UserError : no such material is known, or not at the source's wavelengths.
    """
    nm = problem.source.wavelength
    for spec in problem.optics:
        if AUTO not in (spec.index, spec.absorption):
            continue
        changes: dict[str, Any] = {}
        if spec.index == AUTO:
            index = _tabulated_index(spec, nm) if spec.indices else find_material(spec.material).index(nm)
            known = known_material(spec)
            changes["index"] = round(index, INDEX_DIGITS)
            changes["density"] = spec.density or (known.density if known and known.density else 0.0)
        if spec.absorption == AUTO:
            changes["absorption"] = absorption_at(spec, nm)
            changes["absorptions"] = spec.absorptions or _absorption_rows(spec, problem.source)
        problem = problem.with_optic(spec, **changes)
    return problem


def require_one_glass(problem: Problem) -> None:
    """Refuse a lens whose keys give two indices, or two absorptions, at the source's wavelength.

    problem : with numbers for index and absorption.

    Raises UserError : names both keys with their values.
    """
    nm = problem.source.wavelength
    for spec in problem.optics:
        others = []
        with suppress(UserError):  # of a table that does not reach that wavelength, or has no rows
            others.append((_tabulated_index(spec, nm), SAME_INDEX, f"{spec.key('indices')}, which have", ""))
        with suppress(UserError):  # of a name that is a label, or a wavelength out of the material's range
            material = find_material(spec.material)
            named = f'{spec.key("material")} = "{spec.material}", which has'
            same = max(SAME_INDEX, material.accuracy or 0.0)
            others.append((material.index(nm), same, named, ", or give the material a name of its own"))
        for index, same, said, remedy in others:
            if abs(index - spec.known_index) > same:
                raise UserError(
                    f"{spec.key('index')} = {spec.known_index:g} contradicts {said} {index:.5f} at {nm:g} "
                    f"nm; leave one of them out{remedy}"
                )
        if spec.absorptions and spec.absorption:
            own, table = float(spec.absorption), tabulated(spec.absorptions, nm, spec.key("absorptions"))
            if abs(table - own) > SAME_ABSORPTION * max(own, table):
                raise UserError(
                    f"{spec.key('absorption')} = {own:g} contradicts {spec.key('absorptions')}, which have "
                    f"{table:g} at {nm:g} nm; leave one of them out"
                )


def known_material(spec: Optic) -> Material | None:
    """Return the material that a lens names, if it is known; else the name is a label."""
    try:
        return find_material(spec.material)
    except UserError:
        return None


def indexing_material(problem: Problem, optic: Optic) -> Material | None:
    """Return the material whose index a lens has at the source's wavelength; None where it is another."""
    material, nm = known_material(optic), problem.source.wavelength
    if material is None or not material.range[0] <= nm <= material.range[1]:
        return None
    same = abs(material.index(nm) - optic.known_index) < 10**-INDEX_DIGITS
    return material if same else None


def wavelengths_of(problem: Problem) -> tuple[Wavelength, ...]:
    """Return the wavelengths at which light is measured: the lines of the spectrum, or the source's own.

    problem : with numbers for index and absorption.

    Raises UserError : the index or the absorption at a wavelength is not known; lumens of light that is not
        seen.
    """
    source = problem.source
    if not source.spectrum:
        nm = source.wavelength
        return (Wavelength(nm, 1.0, media_at(problem, nm)),)
    lines = spectral_lines(source.spectrum)
    if source.unit == "lm":
        seen = sum(line.weight * line.xyz[1] for line in lines)
        if not seen:
            raise UserError(
                'source.spectrum has no visible light, so that source.unit cannot be "lm"; take "W"'
            )
        # weights are those of lumens, and colours those of a lumen
        lines = tuple(
            replace(line, weight=line.weight * y / seen, xyz=(x / y, 1.0, z / y))
            for line, (x, y, z) in ((line, line.xyz) for line in lines)
            if y
        )
    media = [media_at(problem, line.nm) for line in lines]
    return tuple(Wavelength(line.nm, line.weight, row, line.xyz) for line, row in zip(lines, media))


def media_at(problem: Problem, nm: float, absorbing_at: float | None = None) -> tuple[Medium, ...]:
    """Return the media before, between and behind the faces that light meets, at a wavelength, nm.

    absorbing_at : nm, another wavelength at which they absorb; None is the same.

    Raises UserError : index or absorption of a lens is not known there.
    """
    at, own = nm if absorbing_at is None else absorbing_at, problem.source.wavelength
    behind = (
        Medium(index_at(face.optic, nm, own), absorption_at(face.optic, at)) if face.into_glass else AIR
        for face in problem.faces_met
    )
    return AIR, *behind


def index_at(spec: Optic, nm: float, own: float) -> float:
    """Return the index of a lens at a wavelength, nm.  own : that of the source.

    lens.index holds at the source's own wavelength.  Elsewhere it is that of lens.indices; without them
    lens.index + n(nm) - n(source.wavelength), with the dispersion n of the material.

    Raises UserError : neither tells the index there.
    """
    if nm == own:
        return spec.known_index
    if spec.indices:
        return _tabulated_index(spec, nm)
    material = known_material(spec)
    if material is None:
        raise UserError(
            f"source.spectrum needs the index at {nm:.4g} nm too, but {spec.key('index')} is one number: "
            f'name a known {spec.key("material")}, such as "PMMA", or give {spec.key("indices")} = '
            "[[nm, index], ...]"
        )
    return spec.known_index + material.index(nm) - material.index(own)


def absorption_at(spec: Optic, nm: float) -> float:
    """Return the absorption of a lens at a wavelength, 1/mm; left to the program it is that of the material.

    nm : of it.

    Raises UserError : lens.absorptions has rows, but not around the wavelength; no material tells it there.
    """
    if spec.absorptions:
        return tabulated(spec.absorptions, nm, spec.key("absorptions"))
    if spec.absorption == AUTO:
        return float(f"{find_material(spec.material).absorption(nm):.{ABSORPTION_DIGITS}g}")
    return float(spec.absorption)


def _absorption_rows(spec: Optic, source: Source) -> tuple[tuple[float, float], ...]:
    """Return the absorption of the material at all wavelengths that are traced, and where it is visible."""
    lines = spectral_lines(source.spectrum) if source.spectrum else ()
    rows = {nm: absorption_at(spec, nm) for nm in (source.wavelength, *(line.nm for line in lines))}
    for nm in map(float, VISIBLE):
        with suppress(UserError):
            rows.setdefault(nm, absorption_at(spec, nm))
    return tuple(sorted(rows.items()))


def _tabulated_index(spec: Optic, nm: float) -> float:
    return tabulated(spec.indices, nm, spec.key("indices"), CAUCHY)
