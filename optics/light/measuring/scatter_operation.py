"""Sums of scattered numbers as a custom operation of Dr.Jit, differentiable backward and forward."""

from __future__ import annotations

from functools import cache
from typing import Any

from optics.base.runtime import Backend, DrArray, OrderFreeSums


@cache
def scatter_operation(base: type[Any]) -> type[Any]:
    """Return the operation (backend, size, packets, numbers, active, most) -> sums.

    size : how many sums.  packets : of summands that are added side by side.
    numbers : which of the packets of sums they are added to.  active : which rays add any.
    most : as of `OrderFreeSums`; None for the sum of the moduli of all summands.  base : dr.CustomOp.
    """

    class Scattered(base):
        def eval(
            self,
            backend: Backend,
            size: int,
            packets: list[DrArray],
            numbers: list[DrArray],
            active: DrArray,
            most: float | None,
        ) -> DrArray:
            self.backend, self.size, self.numbers, self.active = backend, size, numbers, active
            self.Packet = type(packets[0])
            return self.summed(packets, self.moduli(packets) if most is None else most)

        def backward(self) -> None:
            gather, slopes = self.backend.dr.gather, self.grad_out()
            packets = [gather(self.Packet, slopes, number, self.active) for number in self.numbers]
            self.set_grad_in("packets", packets)

        def forward(self) -> None:
            changes = self.grad_in("packets")
            self.set_grad_out(self.summed(changes, self.moduli(changes)))

        def moduli(self, packets: list[DrArray]) -> float:
            """Return the sum of the moduli of all summands."""
            dr = self.backend.dr
            of_ray = sum(dr.abs(number) for packet in packets for number in packet)
            return float(dr.sum(dr.select(self.active, of_ray, 0)).numpy()[0])

        def summed(self, packets: list[DrArray], most: float) -> DrArray:
            sums = OrderFreeSums(self.backend, self.size, most)
            for packet, number in zip(packets, self.numbers):
                sums.add(tuple(packet), number, self.active)
            return sums.values()

    return Scattered
