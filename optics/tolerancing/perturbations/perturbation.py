"""What may be wrong with a lens and where it stands, as one record that can be scaled and added."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from optics.scene.paths import HeightError
from optics.tolerancing.perturbations.height_errors import HeightSum

Triple = tuple[float, float, float]
ZERO: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Perturbation:
    """How a lens, its source and its target differ from what was designed; all zero is the design.

    lens_shift, source_shift, target_shift : mm, along x, y, z.
    lens_tilt, source_tilt, target_tilt : rad, rotation vectors: about the middle of the lens's front vertex,
        the middle of the source, and the middle of the target.  What is tilted is shifted afterwards.
    front_shift, front_tilt : the same of the front alone, about its vertex, in the frame of the lens.
    thickness : mm, added; the rear moves, the target stays.  index : added.
    front_power, rear_power : relative change of the curvature of the base conic, R becomes R / (1 + power);
        the spline above it stays.
    source_size : relative change of the source's width, at the same flux.
    temperature : K above that of the design: the lens alone expands, and its index changes.
    front_error, rear_error : what is added to the heights of front and rear, mm; None is nothing.
    """

    lens_shift: Triple = ZERO
    lens_tilt: Triple = ZERO
    front_shift: Triple = ZERO
    front_tilt: Triple = ZERO
    source_shift: Triple = ZERO
    source_tilt: Triple = ZERO
    target_shift: Triple = ZERO
    target_tilt: Triple = ZERO
    thickness: float = 0.0
    index: float = 0.0
    front_power: float = 0.0
    rear_power: float = 0.0
    source_size: float = 0.0
    temperature: float = 0.0
    front_error: HeightError | None = None
    rear_error: HeightError | None = None

    def __add__(self, other: Perturbation) -> Perturbation:
        """Return the sum of both, number by number."""
        return Perturbation(
            **{f.name: _sum(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)}
        )

    def __mul__(self, factor: float) -> Perturbation:
        """Return it with every number, and every error of height, times a factor."""
        return Perturbation(**{f.name: _times(getattr(self, f.name), factor) for f in fields(self)})

    __rmul__ = __mul__

    def __neg__(self) -> Perturbation:
        return self * -1.0


NOMINAL = Perturbation()


def _sum(a: Any, b: Any) -> Any:
    """Return the sum of two values of the same field."""
    if isinstance(a, tuple) and isinstance(b, tuple):
        return tuple(p + q for p, q in zip(a, b))
    if isinstance(a, float | int) and isinstance(b, float | int):
        return a + b
    parts = [part for error in (a, b) if error is not None for part in _parts(error)]
    return HeightSum(tuple(parts)) if parts else None


def _times(value: Any, factor: float) -> Any:
    """Return the value of a field times a factor."""
    if isinstance(value, tuple):
        return tuple(factor * v for v in value)
    if isinstance(value, float | int):
        return factor * value
    return None if value is None else HeightSum(tuple((factor * f, error) for f, error in _parts(value)))


def _parts(error: HeightError) -> tuple[tuple[float, HeightError], ...]:
    return error.parts if isinstance(error, HeightSum) else ((1.0, error),)
