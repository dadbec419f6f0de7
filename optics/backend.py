"""The one place that loads Dr.Jit."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Any, TypeAlias

from optics import llvm

DrArray: TypeAlias = Any  # a Dr.Jit array (or a Python number in its place)

PRECISIONS = {"double": ("Float64", 1e-9), "single": ("Float32", 1e-4)}  # array type, resolution in mm


@dataclass(frozen=True)
class Backend:
    """Dr.Jit with the array types of one device and precision.

    dr : the drjit module
    Float, Index : differentiable float and unsigned integer array types
    resolution : mm, within which a ray counts as meeting a surface
    """

    dr: ModuleType
    Float: type[DrArray]
    Index: type[DrArray]
    resolution: float


def load_backend(precision: str = "double", threads: int = 0) -> Backend:
    """Load Dr.Jit's LLVM backend.

    threads : number of threads, 0 for all cores.

    Raises
    ------
    UserError : no usable LLVM library.
    """
    os.environ["DRJIT_LIBLLVM_PATH"] = llvm.choose()
    import drjit

    types = import_module("drjit.llvm.ad")
    drjit.set_thread_count(threads or len(os.sched_getaffinity(0)))
    name, resolution = PRECISIONS[precision]
    return Backend(drjit, getattr(types, name), types.UInt32, resolution)
