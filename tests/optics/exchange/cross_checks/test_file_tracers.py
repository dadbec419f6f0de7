"""What a tracer takes from a STEP file, and what is refused."""

import pytest

from optics.base.runtime import UserError
from optics.exchange.cross_checks import file_tracers, require_tracer
from optics.exchange.cross_checks.file_tracers import index_of
from optics.exchange.verification import StepFile
from tests.optics.cases import small_lens
from thbcad import write_step
from thbcad.lens import Product


@pytest.mark.parametrize("schema", ["AP214", "AP242"])
def test_the_index_is_that_of_the_file(tmp_path, schema):
    product = Product(material="glass, n = 1.7", index=1.4917)
    write_step(small_lens(), tmp_path / "lens.step", product, schema)
    assert index_of(StepFile(tmp_path / "lens.step")) == 1.4917


def test_a_file_without_an_index_is_refused(tmp_path):
    write_step(small_lens(), tmp_path / "lens.step")
    with pytest.raises(ValueError, match="names 0 refractive indices where a lens has one"):
        index_of(StepFile(tmp_path / "lens.step"))


@pytest.mark.parametrize("name", ["mitsuba", "optiland", "occt"])
def test_every_tracer_has_its_number_of_rays(name):
    most = file_tracers.SPEEDS[name].most
    assert require_tracer(name, None) < require_tracer(name, most) == most
    for wrong in (-1, 0, 999, most + 1):
        with pytest.raises(
            UserError, match=f"--rays must lie between 1000 and {most} for {name}.*got {wrong}"
        ):
            require_tracer(name, wrong)


def test_a_tracer_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setattr(file_tracers, "find_spec", lambda package: None)
    with pytest.raises(UserError, match=r'optiland is not installed .*pip install "thbcad\[verify\]"'):
        require_tracer("optiland", None)
