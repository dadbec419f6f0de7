"""A problem for a lens that is there: read with its file, which gives what the problem leaves out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optics.base.runtime import UserError, note, reading
from optics.interface.relighting.lens_in_problem import given_lens
from optics.interface.relighting.other_light import other_source
from optics.light.outgoing import outgoing_rays
from optics.scene.problem import LensSpec, Problem, Source, Target, Verify, load_problem
from optics.scene.system import System, solvable_system, traceable_system
from thbcad.io import read_lens
from thbcad.lens import Lens

if TYPE_CHECKING:
    from thbcad.cad import ForeignLens

GLASS = {"material": "PMMA"}
AWAY = 10.0  # half-widths of the lens from its rear to a screen, where no target is given
SCREEN: dict[str, Any] = {"kind": "tophat", "lit": [1.0, 1.0], "pixels": [128, 128]}
NO_LIMITS: dict[str, Any] = {  # of the light, where none is requested
    "verify.min_over_mean": 0.0,
    "verify.min_over_max": 0.0,
    "verify.rsd": inf,
    "verify.rel_l2": inf,
    "verify.lit_efficiency": 0.0,
    "verify.stray": inf,
}
NARROW = 0.2  # of its distance: the half-width of such a screen until the light is traced
RAYS = 20_000
HELD = 0.999  # of the light: what such a screen holds
MARGIN = 1.05
WIDEST = 3.0  # times its distance: such a screen is no larger
IN_PLACE = 1e-6  # mm and rad: a lens that lies so in its file has the heights of the problem
MOVED = 1e-6  # mm: where the target was moved by more, it is said


def given_system(
    problem_file: str | Path, changes: Mapping[str, object], lens_file: str | Path, turn: bool
) -> System:
    """Return the system of a problem file with a lens from a file in place of its own.

    The problem may leave out thickness and half-widths of the lens, and the target: then the light falls on a
    screen that holds nearly all of it, and none is requested.

    changes : {dotted key: value}, in place of what the problem says.
    lens_file : lens.json, a result folder, or a STEP file of any program.
    turn : light meets the other side first; of STEP files.

    Raises UserError : a file cannot be read or holds no lens; see `given_lens` and `solvable_system`.
    """
    found = _read(Path(lens_file), turn)
    left_out: dict[str, object] = {}

    def complete(tables: Mapping[str, Any]) -> Mapping[str, object]:
        left_out.update(_left_out(tables, found))
        return left_out

    problem = load_problem(problem_file, changes, complete)
    lens = found if isinstance(found, Lens) else _refitted(found, problem)
    if not isinstance(found, Lens) and "lens.thickness" not in left_out:
        problem = _in_place(problem, found)
    problem, lens = given_lens(problem, lens)
    if "target" in left_out:
        problem = _on_screen(problem, lens)
        place = screen_words(problem)
        note(f"the problem has no [target], so that no light is requested: it falls on {place}; add [target]")
    return solvable_system(problem).with_lens(lens)


def lens_in_light(
    lens_file: str | Path, source: str, away: float, glass: Mapping[str, Any], turn: bool
) -> System:
    """Return the system of a lens from a file in given light, before a screen that holds most of the light.

    lens_file, turn : as of `given_system`.  source : words as of `other_source`.
    away : mm from the rear of the lens to the screen.
    glass : {"index": n} or {"material": name}; {} is PMMA, or the index that a lens.json has.

    Raises UserError : a file that holds no lens or no light, or a place that does not suit.
    """
    found = _read(Path(lens_file), turn)
    tables: dict[str, Any] = {
        name: {"half_width": [float(h) for h in getattr(found, name).half_width]}
        for name in ("front", "rear")
    }
    if isinstance(found, Lens):
        if glass:
            raise UserError(f"{lens_file} has its own index; leave --material and --index out")
        tables["index"] = found.index
    else:
        tables |= glass or GLASS
    problem = Problem(
        title=Path(lens_file).name,
        source=Source(kind="point"),
        lens=LensSpec(thickness=float(found.thickness), **tables),
        target=Target(**SCREEN, distance=away, half_width=(NARROW * away,) * 2),
        verify=Verify(**{name.split(".")[1]: limit for name, limit in NO_LIMITS.items()}),
    )
    other_source(source, problem)  # refuses other words before the lens is fitted
    problem, lens = given_lens(problem, found if isinstance(found, Lens) else _refitted(found, problem))
    light = other_source(source, problem)
    if light.kind == "luminaire":  # whose file has a flux of its own
        light = replace(light, flux=0.0, unit="lm")
    problem = _on_screen(replace(problem, source=light), lens)
    return traceable_system(problem).with_lens(lens)


def screen_words(problem: Problem) -> str:
    """Return where the screen of a problem stands, and its size."""
    x, y = (2 * h for h in problem.target.half_width)
    return f"a screen of {x:.4g} x {y:.4g} mm, {problem.target.distance:g} mm after the lens"


def _read(path: Path, turn: bool) -> Lens | ForeignLens:
    if path.is_dir():
        path = path / "lens.json"
    with reading(path):
        if path.suffix.lower() == ".json":
            if turn:
                raise UserError(f"--turn takes a STEP file, got {path}; take the lens.step beside it")
            return read_lens(path)
        from thbcad.cad import read_lens_solid  # OCCT

        found = read_lens_solid(path)
        return found.turned() if turn else found


def _left_out(tables: Mapping[str, Any], found: Lens | ForeignLens) -> dict[str, object]:
    """Return the keys that a problem leaves to a lens, with their values."""
    lens = tables.get("lens", {})
    if "element" in tables or not isinstance(lens, Mapping):
        return {}
    sizes = {name: [float(h) for h in getattr(found, name).half_width] for name in ("front", "rear")}
    keys: dict[str, object] = {} if "thickness" in lens else {"lens.thickness": float(found.thickness)}
    for name, size in sizes.items():
        face = lens.get(name, {})
        if isinstance(face, Mapping) and "half_width" not in face:
            keys[f"lens.{name}.half_width"] = size
    if "target" not in tables:
        away = AWAY * max(map(max, sizes.values()))
        limits = tables.get("verify", {})
        given = limits if isinstance(limits, Mapping) else {}
        keys["target"] = SCREEN | {"distance": away, "half_width": [NARROW * away] * 2}
        keys |= {key: limit for key, limit in NO_LIMITS.items() if key.split(".")[1] not in given}
    return keys


def _refitted(found: ForeignLens, problem: Problem) -> Lens:
    """Return the Lens of a STEP file, with the index of a problem."""
    with reading(found.path):
        refit = found.refit(System(problem).problem.optic.known_index)
    note(f"{found.path}: {refit}")
    return refit.lens


def _in_place(problem: Problem, found: ForeignLens) -> Problem:
    """Return a problem whose target and source stay where it places them, though front and rear of the file
    begin at other heights than its vertices: freeform surfaces need not touch those."""
    spec, target = problem.lens, problem.target
    if spec is None:
        return problem
    turned = np.abs(found.frame.rotation - np.eye(3)).max() > IN_PLACE
    aside = np.abs(found.frame.shift[:2]).max() > IN_PLACE
    start = 0.0 if turned or aside or spec.front.freeform is None else float(found.frame.shift[2])
    changes: dict[str, object] = {}
    if start:
        changes["source.distance"] = problem.source.distance + start
    moved = spec.thickness - start - found.thickness
    if target.distance not in (None, inf) and abs(moved) > MOVED:
        distance = float(target.distance or 0.0) + moved
        if distance <= 0:
            raise UserError(
                f"the target, {target.distance:g} mm (target.distance) after a lens of {spec.thickness:g} mm "
                f"(lens.thickness), lies within the lens of the file, {found.thickness:.6g} mm thick; leave "
                "lens.thickness out to count target.distance from the rear of the file"
            )
        changes["target.distance"] = distance
        note(
            f"the rear of the file begins {-moved:+.6g} mm from lens.thickness = {spec.thickness:.6g} mm: "
            f"the target stays in its place, {distance:.6g} mm from there; leave lens.thickness out to count "
            "target.distance from the file's rear"
        )
    return problem.with_(**changes) if changes else problem


def _on_screen(problem: Problem, lens: Lens) -> Problem:
    """Return a problem with a screen that holds the light of its lens."""
    system = traceable_system(problem).with_lens(lens)
    rays = outgoing_rays(system, system.backend, RAYS, "target")
    away = float(problem.target.distance or 0.0)
    reach = np.abs(rays.position[:, :2].astype(float))
    arrives = np.isfinite(reach).all(axis=1) & (rays.flux > 0)
    size = [_quantile(reach[arrives, axis], rays.flux[arrives]) for axis in (0, 1)]
    half = [min(max(MARGIN * s, away * 1e-3), WIDEST * away) for s in size]
    return problem.with_(**{"target.half_width": half})


def _quantile(reach: Any, flux: Any) -> float:
    """Return the distance within which nearly all light arrives; 0 of none."""
    if not len(reach):
        return 0.0
    order = np.argsort(reach)
    share = np.cumsum(flux[order]) / flux.sum()
    return float(reach[order][min(int(np.searchsorted(share, HELD)), len(order) - 1)])
