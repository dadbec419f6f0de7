"""What makes a lens a body that leaves a mould, in numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

from thbcad.checks import require_number

MOST_DRAFT = 45.0  # degrees


@dataclass(frozen=True)
class BodyOptions:
    """What makes a lens a body that leaves a mould.

    draft : degrees by which the walls taper, 0 to 45
    parting : z of the parting line, mm, where the body has the outline of its larger surface; None is the
        land, else the middle between the rims of front and rear
    annulus : whether a flat land joins the smaller surface to the outline of the larger
    land : z of that land, mm; None is the smaller surface's rim, 0.1 mm outside of it where it is not level
    edge_radius : mm, between the wall and the surfaces that it meets at the body's outline; 0 is sharp

    Raises
    ------
    ValueError : numbers out of range; a land without an annulus.
    """

    draft: float = 0.0
    parting: float | None = None
    annulus: bool = False
    land: float | None = None
    edge_radius: float = 0.0

    def __post_init__(self) -> None:
        for name in ("draft", "edge_radius"):
            require_number(name, getattr(self, name), least=0.0, finite=True)
        if self.draft > MOST_DRAFT:
            raise ValueError(f"draft must be at most {MOST_DRAFT:g} degrees, got {self.draft:g}")
        for name in ("parting", "land"):
            if getattr(self, name) is not None:
                require_number(name, getattr(self, name), finite=True)
        if self.land is not None and not self.annulus:
            raise ValueError("a land needs annulus = true, got its z alone")

    def scaled(self, factor: float) -> BodyOptions:
        """Return the options of the body enlarged by a factor in x, y and z."""
        parting, land = (None if z is None else factor * z for z in (self.parting, self.land))
        return replace(self, parting=parting, land=land, edge_radius=factor * self.edge_radius)
