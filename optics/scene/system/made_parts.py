"""The elements of a scene as they are made: solids in their own frames, their names, and where they lie."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from optics.base.runtime import Check, UserError
from optics.scene.limits import limit_checks
from optics.scene.problem import Optic
from optics.scene.system.elements import lens_product, pose_of
from optics.scene.system.made_bodies import whole_of
from optics.scene.system.system import System
from thbcad.lens import Lens, Manufacturability, Product, manufacturability
from thbcad.poses import Pose

if TYPE_CHECKING:
    from thbcad.moulds import Made


@dataclass(frozen=True, eq=False)
class MadePart:
    """An element as it is made.

    name : of the element; "lens" of the lens on the axis.  made : its solid, in its own frame.
    product : what its CAD files say of it.  pose : from its own frame to that of the scene.
    """

    name: str
    made: Made
    product: Product
    pose: Pose

    @property
    def file(self) -> str:
        """The STEP file of a fixed one in a result folder."""
        return f"{self.name}.step"


def designed_part(system: System) -> MadePart:
    """Return the element that is designed.  lens : its shape.

    Raises UserError : the lens has no such body for a mould, or no such plate.
    """
    return _part(system.problem.optic, system.designed, system.product)


def manufactured(system: System) -> Manufacturability:
    """Return the metrics of a lens for its manufacture; the volume is that of what is made.

    Raises UserError : as `designed_part`.
    """
    return _manufactured(system.problem.optic, system.designed)


def volume_of_made(optic: Optic, lens: Lens) -> tuple[int, float]:
    """Return (n, more): the volume of what is made is n times that of a lens of this shape, and mm^3 more.

    It is that of the lens itself where no such body or plate is made of it: a shape on its way may be none.
    """
    try:
        made = whole_of(optic, lens)
    except UserError:
        return 1, 0.0
    count = 1 if optic.array is None else optic.array.count
    return count, 0.0 if made is lens else made.volume() - count * lens.volume()


def other_parts(system: System) -> tuple[MadePart, ...]:
    """Return the elements that are not designed; raise as `designed_part`."""
    return tuple(_part(optic, lens, lens_product(system.problem, optic)) for optic, lens in system.others)


def scene_parts(system: System) -> tuple[MadePart, ...]:
    """Return all elements as the parts of an assembly, each under its own name; raise as `designed_part`."""
    designed = designed_part(system)
    designed = replace(designed, product=replace(designed.product, name=designed.name))
    others = {part.name: part for part in other_parts(system)}
    return tuple(others.get(optic.called, designed) for optic in system.problem.optics)


def other_limit_checks(system: System) -> list[Check]:
    """Return the checks of the limits of manufacture of the free elements before the last."""
    return [
        replace(check, name=f"{optic.called}: {check.name}")
        for optic, shape in system.free_others
        for check in limit_checks(system.problem.about(optic), _manufactured(optic, shape))
    ]


def _manufactured(optic: Optic, lens: Lens) -> Manufacturability:
    metrics, made = manufacturability(lens, optic.density or None), whole_of(optic, lens)
    return metrics if made is lens else replace(metrics, volume=made.volume())


def _part(optic: Optic, lens: Lens, product: Product) -> MadePart:
    return MadePart(optic.called, whole_of(optic, lens), product, pose_of(optic))
