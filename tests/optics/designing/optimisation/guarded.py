"""A program that runs with numpy's arrays laid against unreadable pages.

Whoever reads past the end of an array - Dr.Jit's kernels read whole packets of up to 16 numbers -
ends the process here every time, and otherwise only now and then.  Run by test_memory.py.
"""

import ctypes
import mmap
import os

import numpy as np

from tests.optics.cases import tracer_to

PAGE = mmap.PAGESIZE
SET_HANDLER = 304  # PyDataMem_SetHandler in numpy's table of C functions

libc = ctypes.CDLL(None, use_errno=True)
libc.mmap.restype = ctypes.c_void_p
libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
libc.mprotect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
libc.munmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t]

MALLOC = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
CALLOC = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)
REALLOC = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
FREE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)


class Handler(ctypes.Structure):
    """numpy's PyDataMem_Handler."""

    _fields_ = [
        ("name", ctypes.c_char * 127),
        ("version", ctypes.c_uint8),
        ("context", ctypes.c_void_p),
        ("malloc", MALLOC),
        ("calloc", CALLOC),
        ("realloc", REALLOC),
        ("free", FREE),
    ]


sizes = {}  # of the blocks handed out, by address


def allocate(_context, size):
    """Return `size` zeroed bytes that end, up to alignment, where an unreadable page begins."""
    pages = -(-max(size, 1) // PAGE) * PAGE
    base = libc.mmap(
        None, pages + PAGE, mmap.PROT_READ | mmap.PROT_WRITE, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, -1, 0
    )
    libc.mprotect(base + pages, PAGE, 0)
    address = (base + pages - size) & ~15
    sizes[address] = size, base, pages + PAGE
    return address


def release(_context, address, _size):
    if address in sizes:
        _, base, length = sizes.pop(address)
        libc.munmap(base, length)


def reallocate(_context, address, size):
    new = allocate(None, size)
    if address in sizes:
        ctypes.memmove(new, address, min(size, sizes[address][0]))
        release(None, address, 0)
    return new


handler = Handler(
    b"guarded",
    1,
    None,
    MALLOC(allocate),
    CALLOC(lambda c, n, s: allocate(c, n * s)),
    REALLOC(reallocate),
    FREE(release),
)


def guard():
    """Make numpy take its memory from `allocate` from now on."""
    capsule_pointer = ctypes.pythonapi.PyCapsule_GetPointer
    capsule_pointer.restype, capsule_pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    capsule_new = ctypes.pythonapi.PyCapsule_New
    capsule_new.restype, capsule_new.argtypes = (
        ctypes.py_object,
        [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p],
    )
    table = ctypes.cast(
        capsule_pointer(np._core._multiarray_umath._ARRAY_API, None), ctypes.POINTER(ctypes.c_void_p)
    )
    set_handler = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object)(table[SET_HANDLER])
    set_handler(capsule_new(ctypes.addressof(handler), b"mem_handler", None))


def main():
    """Take loss, gradient, image and vertex gradients of a plane and of a curved front, and of two free
    surfaces before a glowing area."""
    from optics.base.runtime import load_backend
    from tests.optics.cases import PLANE, coefficients, small_space
    from tests.optics.designing.optimisation.cases import (
        ANGLES,
        BOTH,
        CUBIC,
        GLOWING,
        make_objective,
        objective_of,
    )
    from thbcad.sags import Conic
    from thbcad.splines import KnotVector

    backend = load_backend("double", 1)
    space = small_space()
    vertices = KnotVector.uniform(1, 7, -10.0, 10.0), KnotVector.uniform(1, 9, -10.0, 10.0)
    hollow = [tuple(KnotVector.uniform(1, 7, -h, h) for _ in "xy") for h in (5.0, 8.0)]
    guard()
    cases = [
        (make_objective(backend, front, space, CUBIC, rays=21), [np.zeros(space.dim)], [vertices])
        for front in (PLANE, Conic(60.0))
    ]
    far = objective_of(backend, tracer_to(backend, BOTH, GLOWING, np.inf), ANGLES)
    for objective, at, knots in [*cases, (far, coefficients(BOTH), hollow)]:
        found = objective(at)
        assert np.isfinite(found.loss)
        assert all(np.isfinite(gradient).all() for gradient in found.gradients)
        objective.vertex_gradients(at, knots)
        objective.image(at)
    print("guarded", len(sizes), flush=True)
    os._exit(0)  # without taking down arrays whose allocator goes first
