"""The words for flux, irradiance and intensity, in watts or in lumens, and the factors that go with them.

Arrays hold light per mm^2, in the far field per square degree.  People read light per m^2 and per steradian.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

PER_STERADIAN = (180 / pi) ** 2  # square degrees
PER_SQUARE_METRE = 1e6  # mm^2


@dataclass(frozen=True)
class Density:
    """Light per area, or per solid angle.

    quantity : its name.  stored : unit of arrays and files.  shown : unit for people.
    factor : from stored to shown.  suffix : of names in JSON files.
    """

    quantity: str
    stored: str
    shown: str
    factor: float
    suffix: str

    def text(self, stored: float) -> str:
        """Return a value of arrays and files as people read it, with its unit."""
        return f"{self.factor * stored:.4g} {self.shown}"


@dataclass(frozen=True)
class Units:
    """The units of a problem's light.

    flux : "W" or "lm".  suffix : of names of fluxes in JSON files.
    in_plane, in_far_field : of the light on a target.
    """

    flux: str
    suffix: str
    in_plane: Density
    in_far_field: Density

    def density(self, far_field: bool) -> Density:
        """Return the units of the light on a target."""
        return self.in_far_field if far_field else self.in_plane

    def key(self, name: str) -> str:
        """Return the name of a flux in JSON files: "fates" becomes "fates_w" or "fates_lm"."""
        return f"{name}_{self.suffix}"

    @property
    def luminous(self) -> bool:
        """Whether light counts as the eye sees it."""
        return self.flux == "lm"


WATTS = Units(
    "W",
    "w",
    Density("irradiance", "W/mm^2", "W/m^2", PER_SQUARE_METRE, "w_m2"),
    Density("intensity", "W/degree^2", "W/sr", PER_STERADIAN, "w_sr"),
)
LUMENS = Units(
    "lm",
    "lm",
    Density("illuminance", "lm/mm^2", "lx", PER_SQUARE_METRE, "lx"),
    Density("intensity", "lm/degree^2", "cd", PER_STERADIAN, "cd"),
)
BY_FLUX = {units.flux: units for units in (WATTS, LUMENS)}


def units_of(flux: str) -> Units:
    """Return the Units of a flux in "W" or "lm"."""
    return BY_FLUX[flux]
