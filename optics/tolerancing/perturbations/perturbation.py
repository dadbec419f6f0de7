"""What may be wrong with a lens and where it stands, as one record that can be scaled and added."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Self

from optics.scene.paths import HeightError
from optics.scene.problem import Optic
from optics.tolerancing.perturbations.height_errors import HeightSum

Triple = tuple[float, float, float]
ZERO: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ElementErrors:
    """How a lens or a mirror differs from what was designed; all zero is the design.

    A mirror is asked as a lens whose front reflects.

    lens_shift : mm, along its own x, y, z.  lens_tilt : rad, a rotation vector about the middle of its front
        vertex.  What is tilted is shifted afterwards.
    front_shift, front_tilt : the same of the front alone, about its vertex, in the frame of the lens.
    thickness : mm, added; the rear moves, all else stays.  index : added.
    front_power, rear_power : relative change of the curvature of the base conic, R becomes R / (1 + power);
        the spline above it stays.
    temperature : K above that of the design: the lens alone expands, and its index changes.
    front_error, rear_error : what is added to the heights of front and rear, mm; None is nothing.
    """

    lens_shift: Triple = ZERO
    lens_tilt: Triple = ZERO
    front_shift: Triple = ZERO
    front_tilt: Triple = ZERO
    thickness: float = 0.0
    index: float = 0.0
    front_power: float = 0.0
    rear_power: float = 0.0
    temperature: float = 0.0
    front_error: HeightError | None = None
    rear_error: HeightError | None = None

    def __add__(self, other: Self) -> Self:
        """Return the sum of both, number by number."""
        return type(self)(
            **{f.name: _sum(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)}
        )

    def __mul__(self, factor: float) -> Self:
        """Return it with every number, and every error of height, times a factor."""
        return type(self)(**{f.name: _times(getattr(self, f.name), factor) for f in fields(self)})

    __rmul__ = __mul__

    def __neg__(self) -> Self:
        return self * -1.0


RIGHT = ElementErrors()


@dataclass(frozen=True)
class Perturbation(ElementErrors):
    """How a lens, its source and its target differ from what was designed; all zero is the design.

    In a row of elements its own numbers are those of the element that is designed.

    source_shift, source_tilt : mm, rad, about the middle of the source, along the axes of the scene.
    target_shift, target_tilt : the same of the target, along its own axes.
    source_size : relative change of the source's width, at the same flux.
    others : of the other elements, by name.
    """

    source_shift: Triple = ZERO
    source_tilt: Triple = ZERO
    target_shift: Triple = ZERO
    target_tilt: Triple = ZERO
    source_size: float = 0.0
    others: Mapping[str, ElementErrors] = field(default_factory=dict)

    @classmethod
    def on(cls, optic: Optic, designed: Optic, **errors: Any) -> Perturbation:
        """Return the one with errors of an element, as `ElementErrors`.  designed : see `of`."""
        return cls(**errors) if optic is designed else cls(others={optic.called: ElementErrors(**errors)})

    def of(self, optic: Optic, designed: Optic) -> ElementErrors:
        """Return what is wrong with an element.  designed : the one that the own numbers are of."""
        return self if optic is designed else self.others.get(optic.called, RIGHT)


NOMINAL = Perturbation()


def _sum(a: Any, b: Any) -> Any:
    """Return the sum of two values of the same field."""
    if isinstance(a, tuple) and isinstance(b, tuple):
        return tuple(p + q for p, q in zip(a, b))
    if isinstance(a, Mapping):
        return {name: a.get(name, RIGHT) + b.get(name, RIGHT) for name in {**a, **b}}
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
    if isinstance(value, Mapping):
        return {name: factor * errors for name, errors in value.items()}
    return None if value is None else HeightSum(tuple((factor * f, error) for f, error in _parts(value)))


def _parts(error: HeightError) -> tuple[tuple[float, HeightError], ...]:
    return error.parts if isinstance(error, HeightSum) else ((1.0, error),)
