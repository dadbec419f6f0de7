"""The light of mapped cells as a custom operation of Dr.Jit, differentiable backward and forward."""

from __future__ import annotations

from functools import cache
from typing import Any

from optics.base.runtime import DrArray


@cache
def cell_operation(base: type[Any]) -> type[Any]:
    """Return the operation (MappedCells, a, b, flux, sound) -> image.  base : dr.CustomOp."""

    class Mapped(base):
        def eval(self, cells: Any, a: DrArray, b: DrArray, flux: DrArray, sound: DrArray) -> DrArray:
            self.cells, self.Float = cells, type(a)
            self.corners = cells.corners(a, b, flux, sound)
            image, self.places = cells.image(self.corners)
            return self.Float(image)

        def backward(self) -> None:
            slopes = self.cells.adjoint(self.corners, self.places, self.grad_out())
            for name, slope in zip(("a", "b", "flux"), slopes):
                self.set_grad_in(name, self.Float(slope))

        def forward(self) -> None:
            changes = self.cells.directions(self.corners, *map(self.grad_in, ("a", "b", "flux")))
            self.set_grad_out(self.Float(self.cells.tangent(self.corners, self.places, *changes)))

    return Mapped
