"""What the runs of the pearl and of the extended source keep of every batch, and of the project's designs.

Numbers are columns with a row per batch; arrays end in the number of the batch, from 0.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import optics
from benchmarks.thesis.chapter6.adam_batches import Batch, Plan, adam_batches
from benchmarks.thesis.chapter6.second_tracer import step_loss
from benchmarks.thesis.lens_runs import measured_merit, sag_figures, unfiltered_target
from benchmarks.thesis.records import Found
from optics.base.runtime import load_backend
from optics.interface.api import System
from optics.light.analysis import Measurement
from optics.light.engines import ExactEngine
from thbcad import Lens, THBSurface
from thbcad.hierarchy import THBSpace
from thbcad.io import json_text, sag_from_dict, sag_to_dict
from thbcad.lens import require_sound

Floats = NDArray[np.float64]
# of a lens and what it delivers: further numbers, and arrays for pictures
Extra = Callable[[Lens, Measurement], Found]

SHOWN = 161  # points across a surface in pictures
MERGED = 2  # vertices in each direction of a point in the pictures of their gradients


def recorded(
    system: System,
    plan: Plan,
    check: tuple[int, int] | None = None,
    extra: Extra = lambda *_: Found({}),
    pictures: bool = True,
    each: bool = True,
) -> Found:
    """Return what the batches of a plan came to.

    check : rays with which the STEP file of every batch is traced by the second tracer; None traces none.
    pictures : surfaces, meshes and gradients of every batch are kept; the last light and sag always are.
    each : the light of every batch is measured, and not that of the last one alone.
    """
    columns: dict[str, list[Any]] = {"step": list(plan.steps)}
    arrays: dict[str, NDArray[Any]] = {}
    losses, earlier = [], None
    for k, batch in enumerate(adam_batches(system, plan)):
        row, shown = _numbers(system, batch, earlier), _shown(batch) if pictures else {}
        if check:
            row |= _second(system, plan, batch, check)
        if each or k + 1 == len(plan.steps):
            found = system.measure(batch.lens)
            more = extra(batch.lens, found)
            row |= measured_merit(found, batch.lens) | more.numbers
            shown |= more.arrays if pictures else {}
        for key, value in row.items():
            columns.setdefault(key, []).append(value)
        arrays |= {f"{name} {k}": array for name, array in shown.items()}
        losses.append(batch.training.losses[:-1])
        earlier = batch.vertices
    columns["alpha"].pop()  # behind the last batch nothing is refined
    arrays |= {"losses": np.concatenate(losses), "light": found.irradiance, "wanted": found.target}
    numbers = {"iterations": plan.iterations, "pixels": len(found.target), "rays": plan.rays[0], **columns}
    return Found(numbers, {**_small(arrays), "sag": packed(batch.sag)})


def designed(problem: optics.Problem, extra: Extra = lambda *_: Found({})) -> Found:
    """Return what the project's own design of a problem came to."""
    design = optics.design(problem)
    figures = measured_merit(design.measurement, design.lens)
    figures |= extra(design.lens, design.measurement).numbers
    figures |= {"dof": design.metrics["dof"], "evaluations": design.metrics["evaluations"]}
    figures |= {"z_freedom": problem.lens.rear.freeform.freedom, "net": _net(design.lens.sags[-1].space)}
    light = {"light": design.irradiance, "wanted": design.measurement.target}
    return Found(figures, {**_small(light), "sag": packed(design.lens.sags[-1])})


def _net(space: THBSpace) -> int:
    """Return the degrees of freedom of the space with all cells of its finest level."""
    return int(np.prod([kv.dim for kv in (space.embedding.kv_u, space.embedding.kv_v)]))


def _small(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return arrays with the floating numbers in single precision, which does for pictures."""
    return {name: a.astype(np.float32) if a.dtype == np.float64 else a for name, a in arrays.items()}


def packed(sag: THBSurface) -> NDArray[np.uint8]:
    """Return the text of a sag as an array of its bytes."""
    return np.frombuffer(json_text(sag_to_dict(sag)).encode(), np.uint8)


def unpacked(array: NDArray[np.uint8]) -> THBSurface:
    """Return the sag of `packed`."""
    return sag_from_dict(json.loads(array.tobytes()))


def _numbers(system: System, batch: Batch, earlier: Floats | None) -> dict[str, Any]:
    """Return the figures of a batch; `earlier` are the gradients of the vertices of the batch before."""
    change = 0.0 if earlier is None else 1 - _cosine(batch.vertices, earlier)
    pixel = system.target.screen().pixel_area
    return {
        "loss": batch.loss,
        "first_loss": float(batch.training.losses[0]),
        "alpha": float(batch.alpha),
        "exists": _exists(batch.lens),
        "optimisation_seconds": float(batch.training.seconds[-1]),
        "onto_target": float(batch.irradiance.sum() * pixel),
        "gradients": float(batch.vertices.sum()),
        "change_of_gradients": change,
        **_changes(batch),
        **sag_figures(batch.sag),
    }


def _changes(batch: Batch) -> dict[str, float]:
    """Return the rms change of the surface in the inner half of its width, and outside of it, mm.

    gradients_centre : the share of that half in the gradients of the vertices.
    """
    kv_u, kv_v = batch.sag.space.kv_u, batch.sag.space.kv_v
    u, v = (np.linspace(kv.start, kv.stop, SHOWN) for kv in (kv_u, kv_v))
    square = (batch.sag.grid(u, v) - batch.before.grid(u, v)) ** 2
    centre = (np.abs(u) < kv_u.stop / 2)[:, None] & (np.abs(v) < kv_v.stop / 2)
    inner = tuple(slice(n // 4, n - n // 4) for n in batch.vertices.shape)
    return {
        "gradients_centre": float(batch.vertices[inner].sum() / (batch.vertices.sum() or 1.0)),
        "changed_centre": float(np.sqrt(square[centre].mean())),
        "changed_ring": float(np.sqrt(square[~centre].mean())),
    }


def _cosine(a: Floats, b: Floats) -> float:
    return float(np.vdot(a, b) / (np.linalg.norm(a) * np.linalg.norm(b) or 1.0))


def _second(system: System, plan: Plan, batch: Batch, rays: tuple[int, int]) -> dict[str, float | None]:
    """Return the losses by both tracers at equal rays; None of a lens that cannot exist and has no file."""
    if not _exists(batch.lens):
        return {"loss_of_check": None, "step_loss": None}
    engine = ExactEngine(load_backend("double", system.problem.run.threads), soft_rim=0.0)
    model = system.model(batch.sag.space, rays=rays, window="gaussian", engine=engine)
    wanted = model.target if plan.filtered else unfiltered_target(system)
    seen = model(batch.sag.coefficients)
    sigma = system.problem.optimizer.sigma
    return {
        "loss_of_check": float(np.linalg.norm(seen - wanted) / np.linalg.norm(wanted)),
        "step_loss": step_loss(system, batch.lens, wanted, rays, sigma),
    }


def _exists(lens: Lens) -> bool:
    """Return whether a lens can exist: its surfaces and edges do not cross."""
    try:
        require_sound(lens)
    except ValueError:
        return False
    return True


def _shown(batch: Batch) -> dict[str, NDArray[Any]]:
    """Return what the pictures of a batch show."""
    space, (nx, ny) = batch.sag.space, (n // MERGED * MERGED for n in batch.vertices.shape)
    u, v = (np.linspace(kv.start, kv.stop, SHOWN) for kv in (space.kv_u, space.kv_v))
    surface = batch.sag.grid(u, v)
    blocks = batch.vertices[:nx, :ny].reshape(nx // MERGED, MERGED, ny // MERGED, MERGED)
    return {
        "difference": surface - batch.before.grid(u, v),
        "surface": surface,
        "boxes": space.boxes,
        "levels": space.cells[:, 0].astype(np.uint8),
        "vertices": blocks.mean(axis=(1, 3)),
        "irradiance": batch.irradiance,
    }
