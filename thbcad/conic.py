"""Conic sections of revolution about z."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Coordinate = TypeVar("Coordinate", float, NDArray[np.float64])


@dataclass(frozen=True)
class Conic:
    """The conic z = c r^2 / (1 + sqrt(1 - (1 + K) c^2 r^2)), c = 1 / radius (thesis 3.2).

    radius : float, mm; inf is a plane.  constant : float, K = -1 is a paraboloid.
    """

    radius: float = np.inf
    constant: float = 0.0

    def __post_init__(self) -> None:
        for name in ("radius", "constant"):
            object.__setattr__(self, name, float(getattr(self, name)))
        if np.isnan(self.radius) or self.radius == 0:
            raise ValueError(f"radius must be a number other than 0, got {self.radius}")
        if not np.isfinite(self.constant):
            raise ValueError(f"conic constant must be finite, got {self.constant}")

    @property
    def is_plane(self) -> bool:
        return bool(np.isinf(self.radius))

    @property
    def is_paraboloid(self) -> bool:
        """True where the conic is a polynomial of degree 2: planes and K = -1."""
        return self.is_plane or self.constant == -1.0

    def require(self, half_width: tuple[float, float]) -> None:
        """Raise ValueError unless the conic is defined on the whole rectangle."""
        reach = np.hypot(*half_width)
        if not self.is_plane and (1 + self.constant) * (reach / self.radius) ** 2 >= 1:
            limit = abs(self.radius) / np.sqrt(1 + self.constant)
            raise ValueError(
                f"the conic (radius {self.radius}, K {self.constant}) ends at r = {limit:.6g} mm, "
                f"but the corner of the aperture lies at r = {reach:.6g} mm"
            )

    def __call__(self, x: Coordinate, y: Coordinate, derivative: tuple[int, int] = (0, 0)) -> Coordinate:
        """Return z or, for derivative (1, 0) or (0, 1), its slope in x or y."""
        c = 1.0 / self.radius
        r2 = x * x + y * y
        root = np.sqrt(1 - (1 + self.constant) * c * c * r2)
        if derivative == (0, 0):
            return c * r2 / (1 + root)
        if derivative == (1, 0):
            return c * x / root + 0 * y
        if derivative == (0, 1):
            return c * y / root + 0 * x
        raise ValueError(f"conics have derivatives (0, 0), (1, 0) and (0, 1), got {derivative}")
