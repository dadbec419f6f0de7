"""The problem as a whole: a record whose keys are checked wherever it comes from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from html import escape
from itertools import dropwhile, pairwise
from math import dist, inf
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError, read_at_most, speaking_of
from optics.scene.keys import checked_values, option, problem_to_toml, record, require_effects, with_changes
from optics.scene.problem.elements import MirrorElement, Placed
from optics.scene.problem.faces_met import FaceMet, PathSpec, faces_met
from optics.scene.problem.lens_schema import LensSpec, Optic
from optics.scene.problem.required_optics import (
    require_named_elements,
    require_optic,
    require_rows,
    require_stops,
)
from optics.scene.problem.required_sources import require_sources
from optics.scene.problem.required_target import require_angles, require_like_light, require_target
from optics.scene.problem.run_schema import Export, Limits, Optimizer, Refinement, Run, Verify
from optics.scene.problem.source_schema import Source
from optics.scene.problem.target_schema import StopSpec, Target
from thbcad.lens import require_line
from thbcad.texts import OtherKind, text_of
from thbcad.toml import toml_tables

MOST_BYTES, MOST_LETTERS = 1 << 26, 1_000_000  # pictures that are given by mistake are recognised
LEAST_MERGED = 4  # pixels each way that merging leaves


@dataclass(frozen=True, kw_only=True)
class Problem:
    """What is asked for: source, lens and target, and how to design it.

    It is checked when it is made, by the rules of a problem file.  Whole numbers become floats and lists
    become tuples; a table may also be given as a dict.  Paths of pictures stay as they are, so they start
    from the current folder.

    Raises UserError : an unknown or missing key, a value of another type or beyond its limits, keys that do
        not go together; it names the key.

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
    element: tuple[Placed, ...] = option((), note="lenses and mirrors anywhere, in place of [lens]")
    path: tuple[PathSpec, ...] = option(
        (), note="the faces that light meets; [] is all elements in their order"
    )
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
        given["source"] = _first_of_list(self.source)
        for name, value in checked_values(Problem, given).items():
            object.__setattr__(self, name, value)
        _require_partners(self)

    @cached_property
    def optics(self) -> tuple[Optic, ...]:
        """The lens, or every element."""
        return tuple(o for o in (self.lens, *self.element) if isinstance(o, Optic))

    @cached_property
    def optic(self) -> Optic:
        """The lens or the mirror whose surface is free, of several the last that light meets; the first where
        none is."""
        return (self.free_optics or self.optics[:1])[-1]

    @cached_property
    def free_optics(self) -> tuple[Optic, ...]:
        """The elements with free surfaces, in the order in which light meets them."""
        met = {face.optic.table: face.optic for face in self.faces_met if face.optic.free}
        return tuple(met.values())

    def about(self, optic: Optic) -> Problem:
        """Return the problem with another of its elements as `optic`, of which limits and keys then speak."""
        other = copy(self)
        other.__dict__["optic"] = optic
        return other

    @cached_property
    def faces_met(self) -> tuple[FaceMet, ...]:
        """The faces that light meets, in their order.

        Raises UserError : light cannot take such a path.
        """
        return faces_met(self.optics, self.path[0] if self.path else None)

    @property
    def flux(self) -> float:
        """Of all sources, in their unit."""
        return sum(source.total for source in self.source.each)

    @property
    def face_names(self) -> tuple[str, ...]:
        """What sentences call the faces that light meets: "rear" of a lone lens, else "L1.rear"."""
        lone = len(self.optics) == 1
        return tuple(f.optic.face_name(f.face) if lone else f.name for f in self.faces_met)

    @property
    def surface_names(self) -> tuple[str, ...]:
        """What fates of light call the surfaces of the path; a lens alone on the axis has its own words."""
        names = ["" if self.lens else face.name for face in self.faces_met]
        return tuple(name and name + " again" * names[:k].count(name) for k, name in enumerate(names))

    def with_optic(self, of: Optic | None = None, **changes: Any) -> Problem:
        """Return a variation with other values of keys of an element.  of : None is the one that is free."""
        if self.lens:
            return replace(self, lens=replace(self.lens, **changes))
        table = (of or self.optic).table
        changed = (e.with_keys(**changes) if e.table == table else e for e in self.element)
        return replace(self, element=tuple(changed))

    @property
    def throw(self) -> float:
        """From the vertex of what is designed on to the middle of the target, mm; inf to the far field."""
        target, optic = self.target, self.optic
        if target.position is None:
            return inf if target.distance is None else target.distance
        if not isinstance(optic, Placed):
            return dist(target.position, (0.0, 0.0, optic.thickness))
        behind = dropwhile(lambda o: o is not optic, (face.optic for face in self.faces_met))
        places = [o.position for o in behind if isinstance(o, Placed)]
        return sum(dist(*ends) for ends in pairwise([*places, target.position]))

    def with_(self, **changes: object) -> Problem:
        """Return a variation: with_(**{"target.distance": 400}) changes a key, and checks as a file does.

        A table that is left out is made where one of its keys is set, such as "lens.front.freeform.degree".

        Raises UserError : see Problem.
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
                    f"; free, degree {free.degree}, {_by(free.spans)} spans, to level {free.max_level}, "
                    f"sag within {free.z_freedom} mm"
                )
        rows["target"] = (
            f"{target.kind}, {target.place}, half-width {_by(target.half_width)} "
            f"{'degrees' if target.far_field else 'mm'}, {_by(target.pixels)} pixels"
        )
        cells = "".join(
            f'<tr><th scope="row">{name}</th><td>{escape(text)}</td></tr>' for name, text in rows.items()
        )
        return f"<table><caption>{escape(self.title)}</caption>{cells}</table>"


def _first_of_list(source: Any) -> Any:
    """Return the first of a list of sources with the others in it, as `Source` holds them."""
    if not isinstance(source, list | tuple) or not source:
        return source
    first, *others = source
    return dict(first if isinstance(first, Mapping) else vars(first)) | {"others": others}


def _by(size: tuple[float, float]) -> str:
    return f"{size[0]:g} x {size[1]:g}"


def _require_partners(problem: Problem) -> None:
    """Refuse a problem that lacks a key which another key asks for, and keys without effect."""
    require_effects(problem)
    _require_elements(problem)
    for key, text in (
        *((optic.key("material"), optic.material) for optic in problem.optics),
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
    require_angles(problem.verify, problem.target)
    if problem.target.zones and problem.source.unit != "lm":
        raise UserError(
            f"zones have limits in cd or lx, and source.unit is {problem.source.unit!r}; set it to "
            '"lm", and source.flux in lumens'
        )
    require_sources(problem.source)
    if not isinstance(spectrum, str):
        require_rows("source.spectrum", spectrum, 0.0, 1e12)
        if spectrum and not any(weight for _, weight in spectrum):
            raise UserError("source.spectrum is dark: every weight is 0; make one greater")
    for each in problem.optics:
        require_optic(each, each is optic)
    require_stops(problem.stop)
    if optic.array is not None:
        require_like_light(problem.target, problem.stop)
        if problem.source.others:
            raise UserError("lens.array repeats one source, or its source.array; leave the others out")
    merge, pixels = problem.optimizer.merge, min(problem.target.pixels)
    if merge > 1 and pixels < LEAST_MERGED * merge:
        raise UserError(
            f"optimizer.merge must leave at least {LEAST_MERGED} pixels each way, got {merge} of {pixels}"
        )
    most = optic.thickness + sum(f.freedom for f in optic.free.values())
    if problem.limits.thickness > most and not optic.automatic:
        raise UserError(
            f"limits.thickness must be at most {most:g} mm, {optic.key('thickness')} and z_freedom together, "
            f"got {problem.limits.thickness:g}"
        )


def _require_elements(problem: Problem) -> None:
    """Refuse [lens] beside [[element]], none of both, more than one free element, and a path of no light."""
    if problem.lens is None and not problem.element:
        raise UserError("the key lens is missing; add it, or an [[element]]")
    if problem.lens and problem.element:
        raise UserError("[lens] is a lens on the axis, in place of [[element]]; leave one of them out")
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
    require_named_elements(problem.element)
    if len(problem.path) > 1 or (problem.path and problem.lens):
        raise UserError(
            f"[[path]] names the faces of every [[element]] once, got {len(problem.path)} tables"
            f"{' beside [lens]' if problem.lens else ''}; keep one, with [[element]]"
        )
    _ = problem.faces_met


def load_problem(
    path: str | Path,
    changes: Mapping[str, object] | None = None,
    complete: Callable[[Mapping[str, Any]], Mapping[str, object]] | None = None,
) -> Problem:
    """Read a problem file and return the Problem; its image paths are made absolute.

    changes : {dotted key: value}, in place of what the file says; see `assignment`.
    complete : returns further keys for the changed tables, such as what they leave to the file of a lens.

    Raises UserError : with one sentence that names the file, the key, what came and what was wanted.
    """
    path = Path(path)
    held = read_at_most(path, MOST_BYTES)
    try:
        text = text_of(held)
        if len(text) > MOST_LETTERS:
            raise UserError(f"{path} has more than {MOST_LETTERS:,} letters; is it the right file?")
        data = toml_tables(text)
    except OtherKind as error:
        remedy = "give a TOML file, such as `thbcad new` prints"
        if error.kind.endswith("picture"):
            remedy = (
                "a picture is the target of one: write it by `thbcad new > my.toml`, then run "
                f"`thbcad check my.toml --set target.image={path.absolute()}`"
            )
        raise UserError(f"{path} is {error.kind}, not a problem file; {remedy}") from None
    except ValueError as error:
        raise UserError(f"{path} cannot be read as TOML: {error}; mend it there") from None
    with speaking_of(path):
        if "source" in data:
            data["source"] = _first_of_list(data["source"])
        data = with_changes(data, changes or {})
        return record(Problem, with_changes(data, complete(data)) if complete else data, path.parent)
