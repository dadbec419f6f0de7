"""The pictures of chapter 7: the program draws what the package computes."""

import importlib.util

import pytest
from PIL import Image

from optics.deconvolution import CASES, compare, figure_7_4
from tests.cases import ROOT


@pytest.fixture(scope="module")
def chapter7():
    spec = importlib.util.spec_from_file_location("chapter7", ROOT / "examples" / "chapter7.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_a_landscape_and_a_comparison_are_drawn(chapter7, tmp_path, capsys):
    figures = {
        "a": chapter7.deconvolution(figure_7_4()),
        "b": chapter7.rectangles(),
        "c": chapter7.best_positions("disk"),
        "d": chapter7.methods(compare(CASES[0])[1]),
    }
    for name, figure in figures.items():
        path = tmp_path / f"{name}.png"
        figure.savefig(path)
        with Image.open(path) as picture:
            assert min(picture.size) > 500
            assert len(set(picture.convert("L").resize((64, 64)).tobytes())) > 20  # it shows something
    assert "441 positions" in capsys.readouterr().out
