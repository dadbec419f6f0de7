"""The pictures of chapter 7: the program draws what the package computes."""

import importlib.util

import pytest
from PIL import Image

from optics.deconvolution import CASES
from tests.cases import ROOT


@pytest.fixture(scope="module")
def chapter7():
    spec = importlib.util.spec_from_file_location("chapter7", ROOT / "examples" / "chapter7.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_a_landscape_and_a_comparison_are_drawn(chapter7, tmp_path, capsys):
    for path in (
        chapter7.deconvolution(tmp_path / "a.png"),
        chapter7.positions("disk", tmp_path / "b.png"),
        chapter7.methods(CASES[0], tmp_path / "c.png"),
    ):
        with Image.open(path) as picture:
            assert min(picture.size) > 500
            assert len(set(picture.convert("L").resize((64, 64)).tobytes())) > 20  # it shows something
    printed = capsys.readouterr().out
    assert "441 positions" in printed
    assert "comes below 0.0000" in printed
