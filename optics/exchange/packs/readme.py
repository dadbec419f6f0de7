"""The README of a pack: its files, which way is up, how to bring it in, and what should come out."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from optics.exchange.packs.expected import ASIDE, Quantity
from optics.scene.ray_files import RaySet
from optics.scene.system import System
from thbcad import __version__
from thbcad.lens import DenseGrid
from thbcad.toml import toml_tables

WIDTH = 100
DRAWING = "drawing.svg"


@cache
def texts() -> dict[str, Any]:
    """Return the texts of READMEs, with the `programs` that packs are for."""
    return toml_tables(files("optics.exchange.packs").joinpath("texts.toml").read_text("utf-8"))


@dataclass(frozen=True, eq=False)
class Told:
    """What a README tells of.

    program : of `texts`.  verdict : of the result.  paths : "all" or "sequential", those of its light.
    chord : mm, of the mesh.  grids : of the points of front and rear.  rows : the numbers to compare.
    rays : before the lens, as their file holds them; None in a pack without light.
    """

    system: System
    program: Mapping[str, Any]
    verdict: str
    paths: str
    chord: float
    grids: Mapping[str, DenseGrid]
    rows: Sequence[Quantity]
    rays: RaySet | None

    def readme(self, names: Iterable[str]) -> bytes:
        """Return README.txt.  names : of the other files."""
        said, facts = texts(), self._facts() | ({} if self.rays is None else self._light(self.rays))
        listed = {n: said["files"][n if n in said["files"] else n.partition(".")[0]] for n in names}
        lines = (_hanging(name, words.format(**facts)) for name, words in listed.items())
        steps = (f"{k}. {step.format(**facts)}" for k, step in enumerate(self.program["steps"], 1))
        light = self.rays is not None
        parts = {
            said["head"]: True,
            said["untested"]: light,
            "FILES\n\n" + "\n".join(lines): True,
            said["no_drawing"]: DRAWING not in listed,
            said["frame"]: True,
            said["light"]: light,
            said["steps"]: True,
            said["expected" if light else "shop"]: True,
            said["all_ways"]: light and self.paths == "all",
            _table(self.rows): True,
        }
        whole = "\n\n".join(part for part, wanted in parts.items() if wanted)
        blocks = whole.format(**facts, steps="\n\n".join(steps)).split("\n\n")
        filled = (b if b.startswith("  ") else textwrap.fill(b.strip(), WIDTH) for b in blocks)
        return ("\n\n".join(filled) + "\n").encode()

    def _facts(self) -> dict[str, Any]:
        lens, problem, verdict = self.system.designed, self.system.problem, self.verdict
        outlined = not lens.rear.outline.is_rectangle
        return {
            "title": problem.title or "Lens",
            "program": self.program["name"],
            "version": __version__,
            "verdict": f"{verdict[:1].upper()}{verdict[1:]}.",
            "thickness": lens.thickness,
            "front": lens.front.half_width,
            "rear": lens.rear.half_width,
            "corners": ", of which the outline leaves out the corners" if outlined else "",
            "points_front": _grid_words(self.grids["front"]),
            "points_rear": _grid_words(self.grids["rear"]),
            "chord": self.chord,
            "index": f"{lens.index:.9g}",
            "wavelength": f"{problem.source.wavelength:g} nm",
            "shown": self.system.density.shown,
        }

    def _light(self, rays: RaySet) -> dict[str, Any]:
        system, source, path = self.system, self.system.problem.source, self.system.path
        screen, receiver = system.target.screen(), system.target.receiver
        losses = [
            "Fresnel's with polarisation" if s.share is None else f"a coating that lets {s.share:.6g} through"
            for s in path.surfaces
        ]
        (u, v), lines = screen.half_width, len(system.wavelengths)
        where = receiver.normal if screen.angular else receiver.points
        place = f"at z = {-source.distance:.9g}" if source.lone else f"at {_vector(system.source.middle)}"
        turned = f", tilted by {_vector(source.own_tilt)} degrees" if any(source.own_tilt) else ""
        beam = "a beam along +z" if system.source.from_afar else place + turned
        far = "directions of the far field, u = atan(l / n), v = atan(m / n) seen along its middle"
        return {
            "source": "several, where rays start" if system.source.several else f"{source.kind}, {beam}",
            "spectrum": (
                f"The lens was measured at {lines} wavelengths: rays_behind has all, rays_source one."
                * (lines > 1)
            ),
            "flux": system.problem.flux,
            "unit": rays.unit,
            "count": len(rays),
            "carried": rays.total,
            "absorption": max(medium.absorption for medium in path.media),
            "losses": losses,
            "screen": far if screen.angular else "a plane",
            "half": (u, v),
            "axes": screen.unit,
            "pixels": screen.pixels,
            "middle": _vector(where(0.0, 0.0)),
            "first": _vector(where(-u, v)),
            "last": _vector(where(u, -v)),
            "normal": _vector(receiver.normal(0.0, 0.0)),
            "aside": ASIDE,
            "ways": "all ways" if self.paths == "all" else "front and rear",
        }


def _hanging(name: str, words: str) -> str:
    return textwrap.fill(f"  {name:<19}  {words}", WIDTH, subsequent_indent=" " * 23)


def _grid_words(grid: DenseGrid) -> str:
    steps = np.concatenate([np.diff(grid.x), np.diff(grid.y)])
    return (
        f"{len(grid.x)} x {len(grid.y)} points, {steps.min():.4g} to {steps.max():.4g} mm apart, all knots "
        f"among them: between them linear interpolation errs by at most {1e3 * grid.linear:.3g} um, Coons "
        f"patches (cubic sides by heights and normals) by at most {1e6 * grid.cubic:.3g} nm, proven"
    )


def _vector(numbers: Sequence[float]) -> str:
    return f"({', '.join(f'{float(n) + 0.0:.9g}' for n in numbers)})"


def _table(rows: Iterable[Quantity]) -> str:
    lines = [f"  {'quantity':<36} {'unit':<8} {'of the lens':>14} {'by the rays':>14} {'within':>10}   found"]
    for r in rows:
        by_rays = "" if r.by_rays is None else f"{r.by_rays:.7g}"
        lines.append(
            f"  {r.name:<36} {r.unit:<8} {r.value:>14.7g} {by_rays:>14} {r.within:>10.2g}   ________"
        )
    return "\n".join(lines)
