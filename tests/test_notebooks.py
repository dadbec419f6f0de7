"""The notebooks of examples/notebooks run; what is stored of them is small and has no traces of a machine."""

import re
import socket

import nbformat
import pytest

from tests.cases import EXAMPLES, ROOT, module_at

NOTEBOOKS = sorted((EXAMPLES / "notebooks").glob("*.ipynb"))
QUICK = "thb_kernel"  # it needs neither Dr.Jit nor matplotlib
LARGEST = 300_000  # bytes
PATHS = re.compile(r"(?<![\w.])/(home|root|work|tmp|usr|opt|Users|mnt)/|site-packages|[A-Z]:\\\\")


@pytest.fixture(scope="module")
def storing():
    """The program that stores notebooks, as a module."""
    return module_at(ROOT / "scripts" / "store_notebooks.py")


def outputs(notebook):
    """Return the stored outputs of a notebook as one text, without the bytes of pictures."""
    data = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    return re.sub(r"[A-Za-z0-9+/=\\n]{400,}", "", str(data))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_stored_outputs_are_small_and_name_no_machine(storing, path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert path.stat().st_size < LARGEST
    text = outputs(notebook)
    assert not PATHS.search(text)
    for private in (str(ROOT), socket.gethostname()):
        assert private not in text
    assert storing.stripped(notebook) == notebook
    assert "image/png" in text or "<svg" in text


def printed(notebook):
    """Return what cells print, without those whose outputs are not stored; numbers become x."""
    kept = [cell for cell in notebook.cells if "unstored" not in cell.metadata.get("tags", ())]
    texts = [o.text for cell in kept for o in cell.get("outputs", ()) if o.get("name") == "stdout"]
    return re.sub(r"\d[\d.,]*(e[+-]?\d+)?", "x", "".join(texts)).split()


@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=() if p.stem == QUICK else pytest.mark.slow, id=p.stem) for p in NOTEBOOKS],
)
def test_a_fresh_run_prints_what_is_stored(storing, path):
    """Numbers may differ from machine to machine: optimisers amplify rounding."""
    stored = nbformat.read(path, as_version=4)
    fresh = storing.executed(path)
    assert printed(storing.stripped(fresh)) == printed(stored)
    said = [o for c in fresh.cells for o in c.get("outputs", ()) if o.get("name") == "stderr"]
    assert not any("Warning" in output.text for output in said)
