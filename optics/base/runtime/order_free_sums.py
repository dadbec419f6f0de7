"""Sums of scattered numbers that are the same bit for bit in any order (Dr.Jit).

Threads add to one place in any order, and a sum of floating-point numbers depends on it.  A sum of integers
does not.  So every summand becomes a whole number of quanta q, and these are added as 64-bit integers:

    S = q sum_k round(x_k / q),    |S - sum_k x_k| <= n q / 2 for n summands.

q is the power of two with 2^61 q <= M < 2^62 q, M being the bound `most`: x_k / q is exact.  Integers are
added modulo 2^64: a sum may leave their range on the way, and is right where its own modulus is at most M in
the end.  So may a summand: multiples of 2^64 are taken from x_k / q before it becomes an integer, which is
exact but for 2^63 - 2^10, which becomes 2^63.  The sum of the moduli of all summands is such a bound M; where
large ones cancel, a far smaller one may be known.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import frexp, isfinite, ldexp, nan

from optics.base.runtime.backend import Backend, DrArray

DIGITS = 62  # of the largest sum, binary; an integer has 63
TURN = 2.0**64  # integers that differ by it are the same
FEW = 0.25  # packets for a sum: with fewer, copies of the sums take longer to fill and to add up
LEAST_EXPONENT = -1000  # of a quantum, so that its inverse is a number


class OrderFreeSums:
    """Sums of the numbers that are added to them, 0 at the start.

    backend : its precision is that of `values`.  size : how many sums.
    most : no sum has a larger modulus in the end; where it is not finite all sums are NaN.
    whole : the sums in quanta, 64-bit integers.
    """

    def __init__(self, backend: Backend, size: int, most: float) -> None:
        self._dr, self._Float, self._types = backend.dr, backend.Float, backend.types
        self.whole = self._dr.zeros(self._types.Int64, size)
        exponent = max(frexp(most)[1] - DIGITS, LEAST_EXPONENT)
        self.quantum = ldexp(1.0, exponent) if isfinite(most) else nan
        # opaque, so that every scale runs the same compiled kernel
        self._per_quantum, self._quantum = (
            self._dr.opaque(self._types.Float64, number) for number in (1 / self.quantum, self.quantum)
        )

    def add(
        self, summands: Sequence[DrArray], packet: DrArray, active: DrArray | bool = True, once: bool = False
    ) -> None:
        """Add one, two or four numbers to as many sums that lie side by side, in a packet by its number.

        once : this is not in a recorded loop, and few packets fall on one place.  Where there are fewer than
            FEW times the sums, threads add to the sums themselves, not to copies of their own.
        """
        dr, types = self._dr, self._types
        whole = [self._whole(types.Float64(x)) for x in summands]
        kind = {1: types.Int64, 2: types.Array2i64, 4: types.Array4i64}[len(whole)]
        few = once and dr.width(packet) < FEW * dr.width(self.whole)
        mode = dr.ReduceMode.Direct if few else dr.ReduceMode.Auto
        dr.scatter_reduce(dr.ReduceOp.Add, self.whole, kind(*whole), packet, active, mode)

    def _whole(self, summand: DrArray) -> DrArray:
        """Return how many quanta a number is, modulo 2^64."""
        quanta = summand * self._per_quantum
        turns = self._dr.floor(self._dr.fma(quanta, 1 / TURN, 0.5))
        return self._types.Int64(self._dr.round(self._dr.fma(turns, -TURN, quanta)))

    def values(self) -> DrArray:
        """Return the sums."""
        return self._Float(self._types.Float64(self.whole) * self._quantum)

    def folded(self, copies: int) -> DrArray:
        """Return the sums over copies of them, of which number k begins with the k-th sum."""
        if copies == 1:
            return self.values()
        dr, Index = self._dr, self._types.UInt32
        size = dr.width(self.whole) // copies
        place = dr.arange(Index, size)
        whole = sum(
            dr.gather(self._types.Int64, self.whole, place + (k * size - k), place >= k)
            for k in range(copies)
        )
        return self._Float(self._types.Float64(whole) * self._quantum)
