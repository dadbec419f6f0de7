"""Loading Mitsuba: what is missing or wrong is told in one sentence."""

import os
from types import SimpleNamespace

import pytest

pytest.importorskip("mitsuba")

from optics.base.runtime import UserError
from optics.exchange.mitsuba import loading as mitsuba_loading
from optics.exchange.mitsuba.loading import MONO, VARIANTS, current_mitsuba, load_mitsuba, mitsuba_backend


@pytest.fixture(autouse=True)
def restored(backend):
    threads = backend.dr.thread_count()
    yield
    load_mitsuba(threads=threads)


def test_it_sets_variant_and_library():
    mi = load_mitsuba("llvm_ad_rgb", threads=1)
    assert mi.variant() == "llvm_ad_rgb"
    assert os.path.exists(os.environ["DRJIT_LIBLLVM_PATH"])
    assert current_mitsuba().variant() == "llvm_ad_rgb"
    load_mitsuba(threads=1)
    assert current_mitsuba().variant() == "llvm_ad_mono"


def test_variants_are_those_of_the_device(backend):
    """Dr.Jit names it once: `Backend.types`."""
    device = backend.types.__name__.removeprefix("drjit.").replace(".", "_")
    assert all(variant.startswith(f"{device}_") for variant in VARIANTS)
    assert f"{device}_mono" == MONO


def test_every_variant_that_is_offered_exists():
    assert set(VARIANTS) <= set(load_mitsuba(threads=1).variants())


@pytest.mark.parametrize("precision", ["double", "single"])
def test_the_backend_has_mitsubas_types(precision):
    mi = load_mitsuba(threads=1)
    backend = mitsuba_backend(mi, precision)
    assert backend.Float is {"double": mi.Float64, "single": mi.Float}[precision]
    assert backend.array([1.0, 2.0]).numpy().dtype == backend.dtype
    assert backend.dr.thread_count() == 1


def test_missing_mitsuba_is_one_sentence(monkeypatch):
    monkeypatch.setattr(mitsuba_loading, "find_spec", lambda name: None)
    with pytest.raises(UserError, match=r'^Mitsuba is not installed; pip install "thbcad\[mitsuba\]"$'):
        load_mitsuba()


def test_another_version_is_refused(monkeypatch):
    monkeypatch.setattr(mitsuba_loading, "loaded", lambda name: SimpleNamespace(__version__="3.10.0"))
    with pytest.raises(UserError, match=r"Mitsuba 3\.10\.0 was found, but 3\.9\.x is wanted"):
        load_mitsuba()


@pytest.mark.parametrize("variant", ["scalar_rgb", "cuda_ad_mono", "nonsense"])
def test_variants_without_llvm_are_refused(variant):
    with pytest.raises(UserError, match=f"variant must be one of llvm_ad_mono, .*, got '{variant}'"):
        load_mitsuba(variant)


def test_a_foreign_variant_is_refused():
    mi = load_mitsuba(threads=1)
    mi.set_variant("scalar_rgb")
    with pytest.raises(UserError, match="got 'scalar_rgb'; call load_mitsuba first"):
        current_mitsuba()
