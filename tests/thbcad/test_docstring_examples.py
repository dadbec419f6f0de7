"""Every class of the public door has an example in its docstring, which runs and prints what it says."""

import doctest
import inspect
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

import thbcad

CLASSES = {name: value for name in thbcad.__all__ if inspect.isclass(value := getattr(thbcad, name))}
NAMES = {
    "np": np,
    "Path": Path,
    "mkdtemp": mkdtemp,
    **{name: getattr(thbcad, name) for name in thbcad.__all__},
}


@pytest.mark.parametrize("name", CLASSES)
def test_the_example_of_a_class_prints_what_it_says(name, tmp_path, capsys):
    test = doctest.DocTestParser().get_doctest(
        inspect.getdoc(CLASSES[name]), {**NAMES, "mkdtemp": lambda: tmp_path}, name, None, None
    )
    assert test.examples
    failed, _ = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test)
    assert failed == 0, capsys.readouterr().out
