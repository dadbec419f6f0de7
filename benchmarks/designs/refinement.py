"""Degrees of freedom of THB meshes against uniform ones at equal error.

Every design has the same start, the same pixels and rays, and the same number of evaluations.
Run: thbcad bench refinement
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import rel_l2_row
from benchmarks.rows.row import Row
from optics.base.runtime import Backend, load_backend
from optics.designing.optimisation import shape_lens
from optics.light.analysis import measure
from optics.light.engines import ExactEngine
from optics.scene.problem import Freeform, Problem, Refinement, load_problem
from optics.scene.system import System

UNIFORM = (3, 4, 5)  # levels
# indicator and alpha, level 5
DECREASE, VERTEX = (0.05, 0.3, 1.0, 3.0), (0.1, 0.3, 1.0, 2.0)
MESHES = [("decrease", a) for a in DECREASE] + [("vertex", a) for a in VERTEX]
WANTED = 0.2  # of the uniform degrees of freedom; not reached where the detail is everywhere, as in the pearl
EQUAL = (
    1.05  # errors within five percent count as equal: runs that differ in rounding only are that far apart
)
LAST = 5  # evaluations, of which the best counts; those before may belong to the coarse pass
LOCAL = ("disk from a square beam", "crescent", "emblem")  # whose detail is local


def rows() -> list[Row]:
    """Return loss, error, degrees of freedom and time of every mesh, and the least share of uniform degrees
    of freedom at equal error."""
    backend = load_backend("double")
    with TemporaryDirectory() as folder:
        return [row for name, problem in cases(Path(folder)) for row in _case(name, problem, backend)]


def _case(name: str, problem: Problem, backend: Backend) -> list[Row]:
    freeform = problem.lens.rear.freeform
    uniform = [
        _run(f"{name}: uniform level {n}", _with_mesh(problem, n, Refinement(alpha=(0.0,))), backend)
        for n in UNIFORM
    ]
    meshes = [
        _run(
            f"{name}: {kind}, alpha {alpha:g}",
            _with_mesh(problem, 5, Refinement(indicator=kind, alpha=(alpha,))),
            backend,
        )
        for kind, alpha in MESHES
    ]
    out = [row for run in (*uniform, *meshes) for row in run.rows]
    for level, one in zip(UNIFORM, uniform):
        full = np.prod([(n << level) + freeform.degree for n in freeform.spans])
        enough = [m.dof for m in meshes if m.error <= EQUAL * one.error]
        share = min(enough) / full if enough else np.inf
        title = f"{name}: share of the {full} degrees of freedom of uniform level {level} at equal error"
        limit = WANTED if name in LOCAL and level == UNIFORM[-1] else None
        out.append(Row(title, share, "", "thesis 0.23" if name == "pearl" else "", limit))
    return out


def cases(folder: Path) -> Iterator[tuple[str, Problem]]:
    """Yield names and problems; the emblem's picture is written into a folder."""
    pearl = load_problem(EXAMPLES / "pearl.toml")
    yield "pearl", pearl
    circle = load_problem(EXAMPLES / "tophat_circle.toml")
    square_beam = replace(
        circle,
        source=replace(circle.source, profile="uniform"),
        optimizer=replace(circle.optimizer, iterations=(60,)),
    )
    for name, shape in (("disk from a square beam", "ellipse"), ("crescent", "crescent")):
        yield name, _with_freedom(replace(square_beam, target=replace(circle.target, shape=shape)))
    path = folder / "emblem.tif"
    Image.fromarray(emblem().astype(np.float32)).save(path)  # floating point: no steps between its greys
    target = replace(pearl.target, image=str(path), encoding="linear")
    yield "emblem", _with_freedom(replace(pearl, target=target))


def emblem() -> NDArray[np.float64]:
    """Return a picture whose detail is local: a star in a ring on a smooth ground."""
    n, (cx, cy), r = 1024, (635, 410), 112
    y, x = np.mgrid[0:n, 0:n] / n
    image = Image.new("L", (n, n))
    draw = ImageDraw.Draw(image)
    draw.ellipse([cx - r, cy - r, cx + r, cy + r], fill=255)
    draw.ellipse([cx - r + 12, cy - r + 12, cx + r - 12, cy + r - 12], fill=0)
    turns = np.pi * np.arange(16) / 8
    reach = (r - 22) * np.where(np.arange(16) % 2, 0.5, 1.0)
    draw.polygon([(cx + q * np.sin(t), cy - q * np.cos(t)) for q, t in zip(reach, turns)], fill=255)
    bright, inside = np.asarray(image) > 127, (n * x - cx) ** 2 + (n * y - cy) ** 2 < r * r
    return np.where(bright, 0.95, np.where(inside, 0.3, 0.45 + 0.25 * x + 0.15 * np.sin(3 * y + 1.5 * x)))


@dataclass(frozen=True)
class _Run:
    """One design: its degrees of freedom, its error, and its rows."""

    dof: int
    error: float
    rows: list[Row]


def _run(name: str, problem: Problem, backend: Backend) -> _Run:
    """Design a lens and measure it."""
    system, start = System(problem), perf_counter()
    shaped, state = shape_lens(system, backend, ExactEngine(backend))
    seconds = perf_counter() - start
    dof, loss = shaped.designed.rear.sag.space.dim, min(row.loss for row in state.history[-LAST:])
    metrics = measure(shaped, backend).metrics
    rows = [
        Row(f"{name}: degrees of freedom", dof),
        Row(f"{name}: loss", loss),
        rel_l2_row(f"{name}: rel_l2", metrics),
        Row(f"{name}: optimisation", seconds, "s"),
    ]
    return _Run(dof, metrics["rel_l2"], rows)


def _with_mesh(problem: Problem, level: int, refinement: Refinement) -> Problem:
    return replace(
        _with_freeform(problem, replace(problem.lens.rear.freeform, max_level=level)), refinement=refinement
    )


def _with_freedom(problem: Problem) -> Problem:
    return _with_freeform(problem, replace(problem.lens.rear.freeform, z_freedom=12.0))


def _with_freeform(problem: Problem, freeform: Freeform) -> Problem:
    return replace(problem, lens=replace(problem.lens, rear=replace(problem.lens.rear, freeform=freeform)))
