"""What light meets on its way from a source: front, rear and receiver, and what it loses there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from optics.tracing.refraction import SMOOTH, SlopeErrors
from thbcad.poses import IDENTITY, Pose

if TYPE_CHECKING:
    from optics.receivers import Receiver
    from optics.tracing.intersections import HeightError
    from thbcad.lens import Lens


@dataclass(frozen=True, eq=False)
class LightPath:
    """Through front and rear of a lens to a receiver.

    A path is a value: what perturbs a lens, or leaves something out, is a map from a path to another one.  A
    map that changes nothing returns the path itself.

    lens : Lens.  receiver : in the frame of the lens, whose front vertex is the origin.
    absorption : a, 1/mm: exp(-a t) of the light is left after the path t from front to rear.
    reflection : light is lost by Fresnel's reflection; without it both surfaces let through all light that
        they refract.
    slope_errors : of both surfaces, by which light is refracted; the surfaces stay where they are.
    height_errors : of front and rear, by which their points move too; traces carry no derivatives then.
    front : from the frame of the front, in which rays are given, to that of the rest of the lens.
    soft_rim : fraction of the half-width.  Within it the flux of rays in any direction fades towards the rim
        of a surface that carries a sag, or lies behind one, so that light over the rim is lost smoothly.
    """

    lens: Lens
    receiver: Receiver
    absorption: float
    reflection: bool = True
    slope_errors: SlopeErrors = SMOOTH
    height_errors: tuple[HeightError | None, HeightError | None] = (None, None)
    front: Pose = IDENTITY
    soft_rim: float = 0.0

    def onto(self, receiver: Receiver) -> LightPath:
        """Return the path to another receiver."""
        return self if receiver is self.receiver else replace(self, receiver=receiver)

    def without_absorption(self) -> LightPath:
        """Return the path through clear glass."""
        return replace(self, absorption=0.0) if self.absorption else self

    def without_reflection(self) -> LightPath:
        """Return the path through ideally coated surfaces."""
        return replace(self, reflection=False) if self.reflection else self

    def with_slope_errors(self, errors: SlopeErrors) -> LightPath:
        """Return the path through surfaces whose slopes err, one number for each ray or for all."""
        same = errors.front is self.slope_errors.front and errors.rear is self.slope_errors.rear
        return self if same else replace(self, slope_errors=errors)

    def with_height_errors(self, front: HeightError | None, rear: HeightError | None) -> LightPath:
        """Return the path through surfaces whose heights err, mm."""
        same = front is self.height_errors[0] and rear is self.height_errors[1]
        return self if same else replace(self, height_errors=(front, rear))

    def with_front_at(self, pose: Pose) -> LightPath:
        """Return the path through a front that lies elsewhere."""
        return self if pose.is_identity and self.front.is_identity else replace(self, front=pose)

    def with_soft_rims(self, share: float) -> LightPath:
        """Return the path over rims within which light fades."""
        return self if share == self.soft_rim else replace(self, soft_rim=share)
