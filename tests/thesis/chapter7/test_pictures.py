"""The pictures of chapter 7: the program draws what the package computes."""

import matplotlib.pyplot as plt
import pytest
from PIL import Image

from examples.thesis.chapter7 import pictures
from examples.thesis.chapter7.comparison import CASES, compare
from examples.thesis.chapter7.deconvolution import figure_7_4


@pytest.mark.slow
def test_a_landscape_and_a_comparison_are_drawn(tmp_path, capsys):
    figures = {
        "a": pictures.deconvolution(figure_7_4()),
        "b": pictures.rectangles(),
        "c": pictures.best_positions("disk"),
        "d": pictures.methods(compare(CASES[0])[1]),
    }
    for name, figure in figures.items():
        path = tmp_path / f"{name}.png"
        figure.savefig(path)
        plt.close(figure)  # tests of other figures count those that are open
        with Image.open(path) as picture:
            assert min(picture.size) > 500
            assert len(set(picture.convert("L").resize((64, 64)).tobytes())) > 20  # it shows something
    assert "441 positions" in capsys.readouterr().out
