"""Every class of the public doors has an example in its docstring, which runs and prints what it says."""

import doctest
import inspect
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

import optics
import thbcad

DOORS = thbcad, optics
OFFERED = {name: (door, getattr(door, name)) for door in DOORS for name in door.__all__}
CLASSES = {name: value for name, (_, value) in OFFERED.items() if inspect.isclass(value)}


def ran(name, names):
    """Return the example of a class, run with names, and how many of its lines print something else."""
    test = doctest.DocTestParser().get_doctest(inspect.getdoc(CLASSES[name]), names, name, None, None)
    failed, _ = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, clear_globs=False)
    return test, failed


@cache
def names_of(door):
    """Return what the examples of a package may use: its names; those of `optics` also the problem."""
    names = {"np": np, "Path": Path, "mkdtemp": mkdtemp}
    names |= {name: value for name, (of, value) in OFFERED.items() if of is door}
    return ran("Problem", names)[0].globs if door is optics else names


@pytest.mark.parametrize("name", CLASSES)
def test_the_example_of_a_class_prints_what_it_says(name, tmp_path, capsys):
    test, failed = ran(name, names_of(OFFERED[name][0]) | {"mkdtemp": lambda: tmp_path})
    assert test.examples
    assert failed == 0, capsys.readouterr().out
