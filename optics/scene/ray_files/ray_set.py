"""The rays of a file: what all formats have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import UserError

Single = NDArray[np.float32]
Unit = Literal["W", "lm"]

UNITS = ("W", "lm")
IN_WATTS = "design it in watts: --set source.unit=W --lens RESULT/lens.json"  # a lens that is there
UNIT_LENGTH = 1e-3  # the greatest difference of a direction's length from 1: files hold single precision


@dataclass(frozen=True, eq=False)
class RaySet:
    """Rays as files hold them, in single precision.

    position : (n, 3) mm.  direction : (n, 3), unit vectors.  flux : (n,) in `unit`.
    unit : "W" or "lm".  wavelength : (n,) nm; None where the rays have none.
    lumens : (n,), where a file has them beside watts; they are not written.

    Raises UserError : wrong shapes, numbers that are not finite, directions that are no unit vectors,
        negative flux.
    """

    position: Single
    direction: Single
    flux: Single
    unit: Unit = "W"
    wavelength: Single | None = None
    lumens: Single | None = None

    def __post_init__(self) -> None:
        n = np.size(self.flux)
        columns = {"position": (n, 3), "direction": (n, 3), "flux": (n,)}
        for name in ("wavelength", "lumens"):
            if getattr(self, name) is not None:
                columns[name] = (n,)
        if self.unit not in UNITS:
            raise UserError(f'the unit of rays must be "W" or "lm", got {self.unit!r}')
        if n == 0:
            raise UserError("there must be at least one ray, got 0")
        for name, shape in columns.items():
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float32)
            if array.shape != shape:
                raise UserError(f"the {name} of rays must have the shape {shape}, got {array.shape}")
            bad = ~np.isfinite(array)
            if bad.any():
                ray = int(np.argwhere(bad)[0][0])
                raise UserError(f"the {name} of ray {ray} is not finite; {int(bad.sum())} numbers are not")
            object.__setattr__(self, name, array)
        length = np.linalg.norm(self.direction.astype(np.float64), axis=1)
        worst = int(np.abs(length - 1).argmax())
        if abs(length[worst] - 1) > UNIT_LENGTH:
            raise UserError(f"the direction of ray {worst} must have length 1, got {length[worst]:g}")
        darkest = int(self.flux.argmin())
        if self.flux[darkest] < 0:
            raise UserError(f"the flux of ray {darkest} must not be negative, got {self.flux[darkest]:g}")
        if self.lumens is not None and self.lumens.min() < 0:
            raise UserError(f"lumens must not be negative, got {self.lumens.min():g}")
        if self.total == 0:
            raise UserError("all rays have no flux")
        if self.wavelength is not None and self.wavelength.min() <= 0:
            raise UserError(f"wavelengths must be positive, got {self.wavelength.min():g} nm")

    @property
    def total(self) -> float:
        """Flux of all rays, in `unit`."""
        return float(self.flux.sum(dtype=np.float64))

    def shares(self, unit: str) -> NDArray[np.float64]:
        """Return the parts of the light that rays have in a unit, as far as they have any in it, (n,)."""
        by_lumens = unit == "lm" and self.lumens is not None and self.lumens.any()
        flux = np.asarray(self.lumens if by_lumens else self.flux, np.float64)
        return flux / flux.sum()

    def __len__(self) -> int:
        return len(self.flux)
