"""The records of a body for a mould, and of a plate of lenses, in a problem file."""

from __future__ import annotations

from dataclasses import dataclass

from optics.scene.keys import AUTO, LONGEST, SHORTEST, option


@dataclass(frozen=True, kw_only=True)
class BodySpec:
    """The body that leaves a mould, as the table [lens.body], which STEP files hold.

    >>> BodySpec(draft=2.0, annulus=True).parting
    'auto'
    """

    draft: float = option(0.0, low=0, high=45, note="degrees by which the walls taper from the parting line")
    parting: float | str = option(
        AUTO,
        low=-LONGEST,
        high=LONGEST,
        note="mm, z of the parting line; auto is that of the land, else midway between the rims",
        auto=True,
    )
    annulus: bool = option(
        False, note="a flat land from the smaller surface's rim to the outline of the larger"
    )
    land: float | str = option(
        AUTO,
        low=-LONGEST,
        high=LONGEST,
        note="mm, z of that land; auto is the rim's, 0.1 mm outside where that is not level",
        auto=True,
        only={"annulus": (True,)},
    )
    edge_radius: float = option(
        0.0, low=0, high=LONGEST, note="mm, between the wall and the surfaces; outside of clear_aperture"
    )


@dataclass(frozen=True, kw_only=True)
class ArraySpec:
    """Like lenses side by side on one plate, each with its own source, as the table [lens.array].

    >>> ArraySpec(columns=2, rows=6, pitch=(25.0,)).pitches
    (25.0, 25.0)
    """

    columns: int = option(low=1, high=100, note="lenses along x")
    rows: int = option(low=1, high=100, note="lenses along y")
    pitch: tuple[float, ...] = option(
        low=SHORTEST, high=LONGEST, note="mm between their axes: one number, or those of x and y"
    )

    @property
    def count(self) -> int:
        """How many lenses there are."""
        return self.columns * self.rows

    @property
    def pitches(self) -> tuple[float, float]:
        """The pitch in x and in y, mm."""
        return self.pitch[0], self.pitch[-1]
