"""What is asked of a tool: its radius, its path, and the machine's limits."""

from __future__ import annotations

from dataclasses import dataclass

from optics.base.runtime import UserError
from thbcad.tools import SURFACES

POSITIVE = {
    "ball": "mm",
    "nose": "mm",
    "step": "mm",
    "feed": "mm for each revolution",
    "rpm": "revolutions for each minute",
    "acceleration": "m/s^2",
    "speed": "mm for each minute",
}
SPEED = 1000.0  # mm for each minute: a ball end of some mm that finishes a plastic
LEAST, MOST = 1e-6, 1e6  # of any number: what is smaller or larger is a slip of the unit
OF_BALL, OF_NOSE = ("step", "speed"), ("feed", "rpm", "acceleration")


@dataclass(frozen=True)
class ToolOrder:
    """A tool and how it cuts; without ball and nose only radii and draft angles are asked for.

    ball : mm, radius of a ball end that cuts in rows.  nose : mm, radius of a nose that turns on a spiral
    step : mm between the rows' points of contact.  feed : mm for each revolution
    None is the largest whose cusps blur nowhere by more than a pixel, or than half the blur that there is.
    rows : "x" or "y", along which the rows of a ball run
    speed : mm for each minute of a ball along its rows; None is SPEED
    rpm : revolutions for each minute.  acceleration : m/s^2, that the machine's z axis can do
    surface : "front" or "rear"; None is every surface that is no plane

    Raises UserError : numbers that are not positive, options that do not go together.

    >>> ToolOrder(nose=0.5, feed=0.02).pitch  # mm, from turn to turn
    0.02
    """

    ball: float | None = None
    nose: float | None = None
    step: float | None = None
    feed: float | None = None
    rows: str = "x"
    rpm: float | None = None
    acceleration: float | None = None
    surface: str | None = None
    speed: float | None = None

    def __post_init__(self) -> None:
        for name, unit in POSITIVE.items():
            number = getattr(self, name)
            if number is None:
                continue
            real = isinstance(number, int | float) and not isinstance(number, bool)
            if not real or not 0 < number < float("inf"):
                raise UserError(f"{name} must be a positive number of {unit}, got {number!r}")
            if not LEAST <= number <= MOST:
                raise UserError(f"{name} must be from {LEAST:g} to {MOST:g} {unit}, got {number!r}")
        if self.ball is not None and self.nose is not None:
            raise UserError("give a ball or a nose, not both: they are two tools")
        for tool, names in (("ball", OF_BALL), ("nose", OF_NOSE)):
            lone = [n for n in names if getattr(self, n) is not None and getattr(self, tool) is None]
            if lone:
                raise UserError(f"{lone[0]} goes with a {tool}; give the radius of one")
        if self.rows not in ("x", "y"):
            raise UserError(f'rows must be "x" or "y", along which the tool runs, got {self.rows!r}')
        if self.surface not in (None, *SURFACES):
            raise UserError(f'surface must be "front" or "rear", got {self.surface!r}')

    @property
    def radius(self) -> float | None:
        """Of the tool, mm."""
        return self.ball if self.ball is not None else self.nose

    @property
    def spiral(self) -> bool:
        """Whether a nose turns."""
        return self.nose is not None

    @property
    def pitch(self) -> float | None:
        """The step of a ball or the feed of a nose, mm."""
        return self.feed if self.spiral else self.step

    @property
    def words(self) -> str:
        """The tool in words."""
        return f"a nose of {self.nose:g} mm" if self.spiral else f"a ball end of {self.ball:g} mm"
