"""The one place that loads Dr.Jit."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from optics.base.runtime.errors import UserError
from optics.base.runtime.garbage import give_back_memory
from optics.base.runtime.llvm import load_llvm, remedy
from optics.base.runtime.lost_interrupts import interrupts_later
from optics.base.runtime.systems import address_limit, usable_cores
from thbcad.doors import loaded

DrArray: TypeAlias = Any  # a Dr.Jit array, or a Python number; Dr.Jit makes its types at run time

LEAST_ROOM = (
    768 << 20
)  # bytes of addresses: with less LLVM fails to load, or Dr.Jit ends the process at its work
ARRAY_TYPES = "drjit.llvm.ad"  # of the device, with derivatives: the one place that names it
PACKET = 64  # numbers, more than any processor handles at once
PACKED = 4  # numbers of `Backend.Packet`
EXPANDED = 4 << 20  # sums, of which every thread has its own: above, threads wait for one another
# by name: Dr.Jit's and numpy's type, resolution
PRECISIONS: dict[str, tuple[str, type[np.floating], float]] = {
    "double": ("Float64", np.float64, 1e-10),
    "single": ("Float32", np.float32, 2e-6),
}


@dataclass(frozen=True)
class Backend:
    """Dr.Jit with the array types of one device and precision.

    dr : the drjit module
    Float, Index : differentiable float and unsigned integer array types
    dtype : of numpy, like Float
    resolution : within which a ray counts as meeting a surface, relative to the lengths of lens and ray
    """

    dr: ModuleType
    Float: type[DrArray]
    Index: type[DrArray]
    dtype: type[np.floating]
    resolution: float

    @property
    def types(self) -> ModuleType:
        """The array types of the device, with derivatives."""
        return import_module(ARRAY_TYPES)

    @property
    def Packet(self) -> type[DrArray]:
        """Array type of four numbers side by side in memory, which are read, written or added to together."""
        return self.types.Array4f64 if self.dtype is np.float64 else self.types.Array4f

    @property
    def Pair(self) -> type[DrArray]:
        """Array type of two numbers side by side in memory."""
        return self.types.Array2f64 if self.dtype is np.float64 else self.types.Array2f

    def with_precision(self, precision: str) -> Backend:
        """Return the same backend with numbers of another precision, a name out of PRECISIONS."""
        name, dtype, resolution = PRECISIONS[precision]
        return replace(self, Float=getattr(self.types, name), dtype=dtype, resolution=resolution)

    def array(self, values: ArrayLike) -> DrArray:
        """Return numbers as a flat Dr.Jit array."""
        flat = np.ravel(values)
        row = self.room(len(flat))
        row[:] = flat
        return self.Float(row)

    def room(self, count: int) -> NDArray[np.floating]:
        """Return zeros that `Float` takes as they are, (count,).

        Its kernels read whole packets, past the end of numpy's memory, and are compiled anew for every
        alignment; so the numbers lie in a longer buffer, from the start of a packet.
        """
        buffer = np.zeros(count + 2 * PACKET, dtype=self.dtype)
        start = -(buffer.ctypes.data // buffer.itemsize) % PACKET
        return buffer[start : start + count]

    def custom(self, operation: type, *arguments: Any) -> Any:
        """Return `dr.custom(operation, *arguments)`; Ctrl-C in it is a KeyboardInterrupt as elsewhere.

        Raises KeyboardInterrupt : Dr.Jit makes a RuntimeError of it, as of all errors.
        """
        try:
            return self.dr.custom(operation, *arguments)
        except RuntimeError as error:
            if isinstance(error.__cause__, KeyboardInterrupt):
                raise KeyboardInterrupt from None
            raise

    def opaque(self, number: float) -> DrArray:
        """Return a number that does not become part of the kernels, which then serve every lens."""
        return self.dr.opaque(self.Float, float(number))

    @contextmanager
    def on_threads(self, most: int) -> Iterator[None]:
        """Work on so many threads at most, and on one at least.

        Threads wait busily for the next kernel.  Where kernels are short, they take more of the cores from
        other processes than they are worth.
        """
        threads = self.dr.thread_count()
        self.dr.set_thread_count(max(1, min(threads, most)))
        try:
            yield
        finally:
            self.dr.set_thread_count(threads)

    def release(self) -> None:
        """Give memory back to the system that Dr.Jit keeps for arrays to come."""
        self.dr.flush_malloc_cache()
        give_back_memory()


def load_backend(precision: str = "double", threads: int | None = 0) -> Backend:
    """Load Dr.Jit's LLVM backend.

    threads : number of threads, 0 for all cores, None for as many as before.

    Raises ImportError : Dr.Jit is not installed.
    Raises UserError : no usable LLVM library.
    Raises MemoryError : too little for it.
    """
    room = address_limit()
    if room is not None and room < LEAST_ROOM:
        raise MemoryError("there is too little room for LLVM")
    load_llvm()
    with interrupts_later():
        drjit = loaded("drjit")
        if not drjit.has_backend(drjit.JitBackend.LLVM):  # where it searched by itself
            raise UserError(f"Dr.Jit found no LLVM library; {remedy()}")
        types = import_module(ARRAY_TYPES)
    if threads is not None:
        drjit.set_thread_count(threads or usable_cores())
    drjit.set_expand_threshold(EXPANDED)
    name, dtype, resolution = PRECISIONS[precision]
    return Backend(drjit, getattr(types, name), types.UInt32, dtype, resolution)
