"""The one place that loads Mitsuba: its version, its LLVM library and its variant."""

import sys
from importlib.util import find_spec
from types import ModuleType

from optics.base.runtime import (
    ARRAY_TYPES,
    PRECISIONS,
    Backend,
    UserError,
    interrupts_later,
    load_llvm,
    usable_cores,
)
from thbcad.doors import loaded, pip_command

VERSION = "3.9."  # 3.10 changes the Mesh class
DEVICE = "_".join(ARRAY_TYPES.split(".")[1:])  # how variants of Dr.Jit's device begin
VARIANTS = tuple(
    f"{DEVICE}_{colours}" for colours in ("mono", "rgb", "spectral", "mono_polarized", "spectral_polarized")
)
MONO = VARIANTS[0]


def load_mitsuba(variant: str = MONO, threads: int = 0) -> ModuleType:
    """Load Mitsuba, set its variant and return the module.

    variant : one that runs on Dr.Jit's device.  In mono variants fluxes are exact; rgb and spectral ones
        scale them by a spectrum.
    threads : of all Dr.Jit kernels, 0 for all cores.

    Raises UserError : no Mitsuba 3.9, no usable LLVM library, a variant that does not run on LLVM.
    Raises MissingPackage : no Dr.Jit.
    """
    if variant not in VARIANTS:
        raise UserError(f"variant must be one of {', '.join(VARIANTS)}, got {variant!r}")
    if find_spec("mitsuba") is None:
        raise UserError(f"Mitsuba is not installed; {pip_command('mitsuba')}")
    load_llvm()
    with interrupts_later():
        mitsuba = loaded("mitsuba")
    if not mitsuba.__version__.startswith(VERSION):
        raise UserError(
            f"Mitsuba {mitsuba.__version__} was found, but {VERSION}x is wanted; {pip_command('mitsuba')}"
        )
    with interrupts_later():
        mitsuba.set_variant(variant)
    loaded("drjit").set_thread_count(threads or usable_cores())
    return mitsuba


def current_mitsuba() -> ModuleType:
    """Return Mitsuba with the variant that is set, or with the mono one where none is.

    Raises UserError : as `load_mitsuba`, of the variant that is set.
    """
    mitsuba = sys.modules.get("mitsuba")
    if mitsuba is None or (variant := mitsuba.variant()) is None:
        return load_mitsuba()
    if variant not in VARIANTS:
        raise UserError(
            f"Mitsuba's variant must be one of {', '.join(VARIANTS)}, got {variant!r}; "
            "call load_mitsuba first"
        )
    return mitsuba


def mitsuba_backend(mitsuba: ModuleType, precision: str = "double") -> Backend:
    """Return the Backend whose arrays go together with Mitsuba's; the number of threads stays as it is."""
    name, dtype, resolution = PRECISIONS[precision]
    return Backend(loaded("drjit"), getattr(mitsuba, name), mitsuba.UInt32, dtype, resolution)
