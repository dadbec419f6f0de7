"""What is made of shapes while they are designed, as far as `limits.mass` asks: lens, body or plate."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite

from optics.designing.penalties.shape_loss import Part
from optics.scene.problem import Limits, Optic
from optics.scene.system import volume_of_made
from thbcad.lens import Lens, Manufacturability, manufacturability


def limited_part(optic: Optic, shape: Lens, limits: Limits) -> Part:
    """Return an element whose shape is to keep limits."""
    return Part(shape, limits, optic.density, _made(optic, shape, limits))


def limited_metrics(optic: Optic, shape: Lens, limits: Limits) -> Manufacturability:
    """Return the metrics of an element with a shape, by which limits are told."""
    metrics, (count, more) = manufacturability(shape, optic.density or None), _made(optic, shape, limits)
    return replace(metrics, volume=count * metrics.volume + more)


def _made(optic: Optic, shape: Lens, limits: Limits) -> tuple[int, float]:
    return volume_of_made(optic, shape) if isfinite(limits.mass) else (1, 0.0)
