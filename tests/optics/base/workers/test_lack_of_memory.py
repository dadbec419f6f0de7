"""A lack of memory is known by what an error follows from, also where Dr.Jit wraps it."""

import errno

import pytest

from optics.base.workers import lacks_memory


def operation(dr, error):
    """Return what Dr.Jit raises where an operation of ours raises an error."""

    class Fails(dr.CustomOp):
        def eval(self):
            raise error

    with pytest.raises(RuntimeError, match=r"drjit\.custom") as raised:
        dr.custom(Fails)
    return raised.value


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        RuntimeError("jit_malloc(): out of memory! Could not allocate 1048576 bytes (backend=LLVM)."),
        RuntimeError("jit_llvm_compile(): could not allocate 4096 bytes of memory!"),
    ],
    ids=["Python", "arrays", "code"],
)
def test_a_lack_of_memory_inside_an_operation_is_known(backend, error):
    assert lacks_memory(error)
    assert lacks_memory(operation(backend.dr, error))


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        ImportError("_flapack.so: failed to map segment from shared object"),
        ImportError("_core.so: cannot allocate memory in static TLS block"),
    ],
)
def test_a_lack_of_memory_of_the_system_is_known(error):
    assert lacks_memory(error)


def test_other_errors_are_none(backend):
    assert not lacks_memory(operation(backend.dr, ZeroDivisionError("by four")))
    assert not lacks_memory(ValueError("out of memory"))
    assert not lacks_memory(OSError(errno.ENOENT, "No such file"))
    assert not lacks_memory(ImportError("no module named memory"))


def after_a_lack(error, cause):
    """Return an error that was raised while a lack of memory was dealt with."""
    try:
        try:
            raise MemoryError
        except MemoryError:
            raise error from cause
    except ValueError as raised:
        return raised


def test_a_lack_of_memory_that_another_error_hides_does_not_count():
    assert lacks_memory(after_a_lack(ValueError(), MemoryError()))
    assert not lacks_memory(after_a_lack(ValueError(), None))
    assert not lacks_memory(after_a_lack(ValueError(), OSError()))
    during = ValueError()
    during.__context__ = MemoryError()
    assert lacks_memory(during)
