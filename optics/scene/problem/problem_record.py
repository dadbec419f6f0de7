"""The problem as a whole: a record whose keys are checked wherever it comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from html import escape
from itertools import pairwise
from math import dist, inf
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError, read_at_most, speaking_of
from optics.scene.problem.elements import MirrorElement, Placed
from optics.scene.problem.key_changes import with_changes
from optics.scene.problem.lens_schema import LensSpec, Optic
from optics.scene.problem.required_apertures import require_apertures
from optics.scene.problem.required_target import require_target
from optics.scene.problem.run_schema import Export, Limits, Optimizer, Refinement, Run, Verify
from optics.scene.problem.schema import LEAST_FLUX, SHORTEST, SOURCES, Rows, Source, StopSpec, Target
from optics.scene.problem.toml_records import AUTO, checked_values, option, problem_to_toml, record
from thbcad.lens import require_line
from thbcad.toml import toml_tables

MAX_FILE_BYTES = 1_000_000
LEAST_SIGMA = 0.005  # of a Gaussian profile: narrower ones fall between the rays
LEAST_INDEX = 1.000001  # of lens.indices: that of lens.index must be greater than 1
LEAST_MERGED = 4  # pixels each way that merging leaves


@dataclass(frozen=True, kw_only=True)
class Problem:
    """What is asked for: source, lens and target, and how to design it.

    It is checked when it is made, by the rules of a problem file.  Whole numbers become floats and lists
    become tuples; a table may also be given as a dict.  Paths of pictures stay as they are, so they start
    from the current folder.

    Raises
    ------
    UserError : an unknown or missing key, a value of another type or beyond its limits, keys that do not go
        together; it names the key.

    Examples
    --------
    >>> sides = {"front": {"half_width": (10, 10)}, "rear": {"half_width": (10, 10)}}
    >>> problem = Problem(
    ...     source=Source(kind="collimated", half_width=(9.5, 9.5)),
    ...     lens={"index": 1.5, "thickness": 6, **sides},
    ...     target=Target(kind="tophat", distance=60, half_width=(20, 20), pixels=(32, 32)),
    ... )
    >>> problem.with_(**{"target.distance": 400}).target.place
    '400 mm behind the lens'
    """

    title: str = option("lens", note="of the report, and the name of the solid where export.product is empty")
    source: Source = option()
    lens: LensSpec | None = option(None, note="the one lens, on the axis, its front vertex at 0")
    element: tuple[Placed, ...] = option((), note="a lens or a mirror anywhere, in place of [lens]")
    target: Target = option()
    stop: tuple[StopSpec, ...] = option((), note="what absorbs light beside the lens; any number of them")
    optimizer: Optimizer = option(Optimizer())
    refinement: Refinement = option(Refinement())
    limits: Limits = option(Limits())
    verify: Verify = option(Verify())
    export: Export = option(Export())
    run: Run = option(Run())

    def __post_init__(self) -> None:
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        for name, value in checked_values(Problem, given).items():
            object.__setattr__(self, name, value)
        _require_partners(self)

    @cached_property
    def optic(self) -> Optic:
        """The lens or the mirror whose surface is free."""
        optic = self.lens or self.element[0]
        assert isinstance(optic, Optic)
        return optic

    def with_optic(self, **changes: Any) -> Problem:
        """Return a variation with other values of keys of the optic."""
        if self.lens:
            return replace(self, lens=replace(self.lens, **changes))
        return replace(self, element=(self.element[0].with_keys(**changes),))

    @property
    def throw(self) -> float:
        """From the rear vertex, or a mirror's, to the middle of the target, mm; inf to the far field."""
        target, optic = self.target, self.optic
        if target.position is None:
            return inf if target.distance is None else target.distance
        if isinstance(optic, Placed):
            return dist(target.position, optic.position)
        return dist(target.position, (0.0, 0.0, optic.thickness))

    def with_(self, **changes: object) -> Problem:
        """Return a variation: with_(**{"target.distance": 400}) changes a key, and checks as a file does.

        A table that is left out is made where one of its keys is set, such as "lens.front.freeform.degree".

        Raises
        ------
        UserError : see Problem.
        """
        return record(Problem, with_changes(asdict(self), changes))

    def to_toml(self) -> str:
        """Return the problem file with every key."""
        return problem_to_toml(self)

    def _repr_html_(self) -> str:
        """Return the main numbers as a table, for notebooks."""
        source, lens, target = self.source, self.optic, self.target
        made_of = f"index {lens.known_index:g}" if lens.known_index else (lens.material or "tabulated index")
        if isinstance(lens, MirrorElement):
            made_of = f"mirror, reflectance {lens.share:g}"
        rows = {
            "source": f"{source.kind}, half-width {_by(source.half_width)} mm, {source.flux:g} {source.unit}",
            "lens": f"{made_of}, thickness {lens.thickness:g} mm",
        }
        for name, surface in (("front", lens.front), ("rear", lens.rear)):
            free = surface.freeform
            rows[name] = (
                f"half-width {_by(surface.half_width)} mm, radius {surface.radius} mm, conic {surface.conic}"
            )
            if free:
                rows[name] += (
                    f"; free, degree {free.degree}, {_by(free.spans)} spans, to level {free.max_level}"
                )
                rows[name] += f", sag within {free.z_freedom} mm"
        rows["target"] = (
            f"{target.kind}, {target.place}, half-width {_by(target.half_width)} "
            f"{'degrees' if target.far_field else 'mm'}, {_by(target.pixels)} pixels"
        )
        lines = (
            f'<tr><th scope="row">{name}</th><td>{escape(text)}</td></tr>' for name, text in rows.items()
        )
        cells = "".join(lines)
        return f"<table><caption>{escape(self.title)}</caption>{cells}</table>"


def _by(size: tuple[float, float]) -> str:
    return f"{size[0]:g} x {size[1]:g}"


def _require_partners(problem: Problem) -> None:
    """Refuse a problem that lacks a key which another key asks for."""
    _require_one_optic(problem)
    for key, text in (
        (problem.optic.key("material"), problem.optic.material),
        ("export.product", problem.export.product),
        ("export.author", problem.export.author),
        ("export.organization", problem.export.organization),
    ):
        try:
            require_line(key, text)
        except ValueError as error:
            raise UserError(str(error)) from None
    optic, spectrum = problem.optic, problem.source.spectrum
    require_target(problem.target)
    _require_source(problem.source)
    if isinstance(optic, LensSpec):
        _require_glass(optic)
    if not isinstance(spectrum, str):
        _require_rows("source.spectrum", spectrum, 0.0, 1e12)
        if spectrum and not any(weight for _, weight in spectrum):
            raise UserError("source.spectrum is dark: every weight is 0; make one greater")
    require_apertures(optic, problem.stop)
    merge, pixels = problem.optimizer.merge, min(problem.target.pixels)
    if merge > 1 and pixels < LEAST_MERGED * merge:
        raise UserError(
            f"optimizer.merge must leave at least {LEAST_MERGED} pixels each way, got {merge} of {pixels}"
        )
    _require_free(optic)
    most = optic.thickness + sum(f.freedom for f in optic.free.values())
    if problem.limits.thickness > most and not optic.automatic:
        raise UserError(
            f"limits.thickness must be at most {most:g} mm, {optic.key('thickness')} and z_freedom together, "
            f"got {problem.limits.thickness:g}"
        )


def _require_one_optic(problem: Problem) -> None:
    """Refuse a problem with another number of elements than one."""
    if problem.lens is None and not problem.element:
        raise UserError("the key lens is missing; add it, or an [[element]]")
    if problem.lens and problem.element:
        raise UserError("[lens] is a lens on the axis, in place of [[element]]; leave one of them out")
    if len(problem.element) > 1:
        raise UserError(
            f"one [[element]] can be designed, got {len(problem.element)}: "
            f"{', '.join(e.name for e in problem.element)}; leave the others out"
        )
    if problem.element and problem.target.distance is not None:
        raise UserError(
            f"target.distance = {problem.target.distance:g} is that of [lens]; beside an [[element]] give "
            'target.position, or target.surface = "far_field"'
        )
    if problem.element and problem.target.position is None and not problem.target.far_field:
        raise UserError(
            "the key target.position is missing (mm, of the middle of the target); add it, or "
            'target.surface = "far_field"'
        )
    for k, element in enumerate(problem.element):
        if not element.name:
            raise UserError(f'element[{k}].name is missing; add one, such as name = "M1"')


def _require_glass(lens: LensSpec) -> None:
    """Refuse a lens of which nobody knows the index."""
    if lens.index == AUTO and not (lens.indices or lens.material):
        raise UserError(
            f"the key {lens.key('index')} is missing (refractive index, relative to the air around); add it, "
            f'or name a known material, such as {lens.key("material")} = "PMMA"'
        )
    _require_rows(lens.key("indices"), lens.indices, LEAST_INDEX, 10.0)
    _require_rows(lens.key("absorptions"), lens.absorptions, 0.0, 1e3)


def _require_free(optic: Optic) -> None:
    """Refuse an element without a surface to design, and a fixed one whose base is left to the program."""
    if not optic.free:
        mirror = isinstance(optic, MirrorElement)
        fixed = optic.key("front.freeform" if mirror else "rear.freeform")
        remedy = "leave it out" if mirror else f"add the table {optic.key('front.freeform')}"
        raise UserError(f"{fixed} = false leaves no surface to design; {remedy}")
    if optic.rear.freeform is None and AUTO in (optic.rear.radius, optic.rear.conic):
        raise UserError(
            f"{optic.key('rear.radius')} and {optic.key('rear.conic')} must be numbers with "
            f'{optic.key("rear.freeform")} = false, got "{AUTO}"'
        )


def _require_rows(key: str, rows: Rows, low: float, high: float) -> None:
    """Refuse rows (nm, value) out of their limits, and wavelengths that come twice."""
    for k, (nm, value) in enumerate(rows):
        if not 1 <= nm <= 1e6:
            raise UserError(f"{key}[{k}][0] must be a wavelength from 1 to 1e+06 nm, got {nm:g}")
        if not low <= value <= high:
            raise UserError(f"{key}[{k}][1] must be from {low:.7g} to {high:g}, got {value:g}")
    wavelengths = sorted(nm for nm, _ in rows)
    for nm, following in pairwise(wavelengths):
        if nm == following:
            raise UserError(f"{key} has several rows for {nm:g} nm; keep one")


def _require_source(source: Source) -> None:
    kind, has = source.kind, SOURCES[source.kind]
    if source.profile == "image" and not source.image:
        raise UserError("the key source.image is missing; add it")
    if source.distance < has.nearest:
        raise UserError(
            f"source.distance must be at least {has.nearest} for a {kind}, which would lie in the lens, "
            f"got {source.distance!r}"
        )
    if has.file and not source.file:
        raise UserError("the key source.file is missing; add it")
    if source.file and not has.file:
        kinds = " and ".join(f'"{name}"' for name, keys in SOURCES.items() if keys.file)
        raise UserError(f"source.file is read by the kinds {kinds} only, got the kind {kind!r}")
    if any(source.tilt) and any(source.turn):
        raise UserError(
            "source.tilt (about own axes) and source.turn (about axes that stay) say one rotation twice; "
            "leave one of them out"
        )
    for key in ("shift", "tilt", "turn"):
        if not SOURCES[source.kind].file and any(getattr(source, key)):
            raise UserError(
                f"source.{key} is that of a file's light; a {source.kind} source lies on the axis and "
                "shines along +z"
            )
    if not source.flux and not has.own_flux:
        raise UserError(f"source.flux must be at least {LEAST_FLUX:.7g}, got {source.flux!r}")
    if has.area and min(source.half_width) < SHORTEST:
        got = list(source.half_width)
        raise UserError(f"source.half_width must be at least {SHORTEST} for a {kind} source, got {got}")
    if has.profiles[1:] and source.profile not in has.profiles:
        known = " or ".join(f'"{name}"' for name in has.profiles)
        raise UserError(
            f"source.profile of a {kind} must be {known}, got {source.profile!r}: "
            "the same intensity from every point is all that its file tells"
        )
    if not has.diverges and (source.divergence or source.divergence_profile != "uniform"):
        raise UserError(
            "source.divergence and source.divergence_profile are those of collimated light; a "
            f"{kind} source has source.half_angle"
        )
    if source.divergence_profile not in ("uniform", "sun") and not source.divergence:
        raise UserError(
            f'source.divergence_profile = "{source.divergence_profile}" needs source.divergence in degrees'
        )
    if source.profile not in has.profiles:
        raise UserError(
            f"source.profile is that of an area, the kind {kind!r} has none; got {source.profile!r}"
        )
    if source.profile in ("gaussian", "round_gaussian") and min(source.sigma) < LEAST_SIGMA:
        raise UserError(
            f"source.sigma must be at least {LEAST_SIGMA}, got {list(source.sigma)}; "
            "take a smaller source.half_width"
        )


def load_problem(path: str | Path, changes: Mapping[str, object] | None = None) -> Problem:
    """Read a problem file and return the Problem; its image paths are made absolute.

    changes : {dotted key: value}, in place of what the file says; see `assignment`.

    Raises
    ------
    UserError : with one sentence that names the file, the key, what came and what was wanted.
    """
    path = Path(path)
    text = read_at_most(path, MAX_FILE_BYTES)
    try:
        data = toml_tables(text.decode("utf-8-sig"))  # editors of Windows put a mark before the text
    except UnicodeDecodeError as error:
        raise UserError(f"{path} is no UTF-8 text from byte {error.start} on; save it as UTF-8") from None
    except ValueError as error:
        raise UserError(f"{path} cannot be read as TOML: {error}; mend it there") from None
    with speaking_of(path):
        return record(Problem, with_changes(data, changes or {}), path.parent)
