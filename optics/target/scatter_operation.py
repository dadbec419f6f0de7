"""Sums of scattered numbers as a custom operation of Dr.Jit, differentiable backward and forward."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from optics.runtime import OrderFreeSums

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray


@cache
def scatter_operation(base: type[Any]) -> type[Any]:
    """Return the operation (backend, size, packets, numbers, active) -> sums.  base : dr.CustomOp.

    size : how many sums.  packets : of summands that are added side by side.
    numbers : which of the packets of sums they are added to.  active : which rays add any.
    """

    class Scattered(base):
        def eval(
            self, backend: Backend, size: int, packets: list[DrArray], numbers: list[DrArray], active: DrArray
        ) -> DrArray:
            self.backend, self.size, self.numbers, self.active = backend, size, numbers, active
            self.Packet = type(packets[0])
            return self.summed(packets)

        def summed(self, packets: list[DrArray]) -> DrArray:
            dr = self.backend.dr
            all_of_ray = sum(abs(number) for packet in packets for number in packet)
            most = float(dr.sum(dr.select(self.active, all_of_ray, 0)).numpy()[0])
            sums = OrderFreeSums(self.backend, self.size, most)
            for packet, number in zip(packets, self.numbers):
                sums.add(list(packet), number, self.active)
            return sums.values()

        def backward(self) -> None:
            dr, slopes = self.backend.dr, self.grad_out()
            self.set_grad_in(
                "packets",
                [dr.gather(self.Packet, slopes, number, self.active) for number in self.numbers],
            )

        def forward(self) -> None:
            self.set_grad_out(self.summed(self.grad_in("packets")))

    return Scattered
