"""The bar in a notebook: one bar, with ipywidgets and without."""

import pytest
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell, new_notebook

PROGRAM = """
import optics.designing.progress.progress_bar as progress_bar
from optics.designing.progress import DesignProgress
{change}
with DesignProgress() as progress:
    progress.over("setup")
    progress._progress.advance(0.5, "10 DOF")
    progress._progress.begin("level 0")
print("done")
"""
WITHOUT = "progress_bar.find_spec = lambda name: None"
STATE = "application/vnd.jupyter.widget-state+json"


def ran(change):
    """Return (all that was written to stderr, the values of the widgets by the names of their models)."""
    notebook = new_notebook(cells=[new_code_cell(PROGRAM.format(change=change))])
    NotebookClient(notebook, timeout=60).execute()
    outputs = notebook.cells[0].outputs
    assert [o.text for o in outputs if o.get("name") == "stdout"] == ["done\n"]
    models = notebook.metadata.get("widgets", {}).get(STATE, {}).get("state", {}).values()
    values = [(m["model_name"], m["state"]["value"]) for m in models if "value" in m["state"]]
    return "".join(o.text for o in outputs if o.get("name") == "stderr"), values


@pytest.mark.slow
def test_with_ipywidgets_the_browser_draws_one_bar():
    said, widgets = ran("")
    assert ("FloatProgressModel", 1.0) in widgets
    texts = [value for name, value in widgets if name == "HTMLModel"]
    assert any("done" in text for text in texts)
    assert not any("\u2588" in text or "|" in text for text in texts)
    assert said.startswith("start surface: 10 DOF, ")
    assert said.count("\n") == 1


@pytest.mark.slow
def test_without_them_it_is_drawn_as_on_a_terminal_and_nobody_is_warned():
    said, widgets = ran(WITHOUT)
    assert widgets == []
    assert said.rstrip().endswith("done")
    assert "Warning" not in said
    assert "100% |" in said
