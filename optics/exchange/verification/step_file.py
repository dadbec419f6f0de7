"""A STEP file under test, read once by each of several programs that share no code, and its volume."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from optics.base.runtime import Check
from thbcad.io import Brep, parse_brep, volume
from thbcad.lens import Lens, OpticalForm

if TYPE_CHECKING:
    from thbcad.cad.exchange import SolidFile, SolidState


@dataclass(frozen=True)
class StepFile:
    """A STEP file, as a rule with a lens solid.

    Ask for `text` before `solid` where the file may be cut off or damaged: OCCT can end the process over it.
    """

    path: Path

    @cached_property
    def text(self) -> Brep:
        """What the text of the file holds.

        Raises
        ------
        OSError : the file cannot be read.  ValueError : it is not whole, or not one solid.
        """
        return parse_brep(self.path)

    @cached_property
    def state(self) -> SolidState:
        """What OCCT says of the shape in the file, a lens or another.

        Raises
        ------
        OSError : the file cannot be read.  ValueError : it is no STEP file.
        """
        from thbcad.cad.exchange import SolidState, step_shape  # OCCT

        return SolidState(step_shape(self.path))

    @cached_property
    def solid(self) -> SolidFile:
        """What OCCT reads in the file.

        Raises
        ------
        OSError : the file cannot be read.  ValueError : it does not hold two optical faces.
        """
        from thbcad.cad.exchange import read_step  # OCCT

        return read_step(self.path)

    def read(self) -> tuple[Brep, SolidState]:
        """Return `text` and `state`; the text is read first, so that a damaged file never reaches OCCT.

        Raises
        ------
        OSError, ValueError : as these.
        """
        return self.text, self.state

    def read_lens(self) -> tuple[Brep, SolidFile]:
        """Return `text` and `solid` of a file that holds a lens, the text first.

        Raises
        ------
        OSError, ValueError : as these; there are not two optical faces.
        """
        from optics.exchange.verification.occt_tracer import optical_faces  # OCCT

        optical_faces(self.text)
        return self.text, self.solid


@dataclass(frozen=True, eq=False)
class ExportedStep:
    """A STEP file as OCCT reads it.

    Another process can return it without loading OCCT in this one.

    checks : of the solid.  front, rear : the optical faces in the file, as `SolidFile` has them.
    """

    checks: list[Check]
    front: OpticalForm
    rear: OpticalForm


def state_checks(state: SolidState, by: str, faces: int | None = None) -> list[Check]:
    """Return the Checks that a shape is one whole solid.

    by : what read the shape.  faces : how many it must have; without a number its shell must be closed.
    """
    counts = {"solids besides the one expected": abs(state.solids - 1)}
    if faces is not None:
        counts[f"faces besides the {faces} expected"] = abs(state.faces - faces)
    counts["free edges"] = state.free_edges
    if faces is None:
        counts["shell not closed"] = not state.closed
    counts["solid not valid"] = not state.valid
    return [Check.none_of(f"{name}, {by}", count) for name, count in counts.items()]


VOLUME = 1e-10  # relative


def text_volume_check(solid: Brep, lens: Lens) -> Check:
    """Return the Check of the volume by quadrature over the text against the lens in memory."""
    return volume_check(solid, lens.volume(), VOLUME)


def volume_check(solid: Brep, wanted: float, limit: float) -> Check:
    """Return the Check of the volume by quadrature over the text against a wanted one, mm^3.

    limit : of the relative difference
    """
    try:
        off = abs(volume(solid) / wanted - 1)
    except ValueError:  # faces that do not close
        off = inf
    name = "volume by quadrature over the text of the file against the closed form, relative"
    return Check(name, off, limit, "")
