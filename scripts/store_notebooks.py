"""Run the notebooks of examples/notebooks and store them with their outputs.

Run: .venv/bin/python scripts/store_notebooks.py [NAME ...]

What differs from run to run is left out: progress, counts of execution, and the outputs of cells with the tag
"unstored".
"""

from __future__ import annotations

import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode

FOLDER = Path(__file__).parents[1] / "examples" / "notebooks"
TIMEOUT = 300  # seconds, of a cell
UNSTORED = "unstored"
WIDGET = "application/vnd.jupyter.widget-view+json"


def executed(path: Path) -> NotebookNode:
    """Return a notebook after a fresh run, in its own folder.

    Raises CellExecutionError : a cell fails.
    """
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(notebook, timeout=TIMEOUT, resources={"metadata": {"path": str(path.parent)}})
    return client.execute()


def stripped(notebook: NotebookNode) -> NotebookNode:
    """Return a notebook with the outputs that are to be stored."""
    kept = nbformat.from_dict(notebook)
    kept.metadata.pop("widgets", None)
    for cell in kept.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell.execution_count = None
            cell.outputs = [] if UNSTORED in cell.metadata.get("tags", ()) else _kept(cell.outputs)
    return kept


def _kept(outputs: list[NotebookNode]) -> list[NotebookNode]:
    """Return outputs without progress; of HTML and text only HTML, and printed pieces as one."""
    out: list[NotebookNode] = []
    for output in outputs:
        if output.get("name") == "stderr" or WIDGET in output.get("data", {}):
            continue
        if "execution_count" in output:
            output.execution_count = None
        if "text/html" in output.get("data", {}):  # the other form of a problem names where its picture lies
            output.data.pop("text/plain", None)
        if out and output.output_type == out[-1].output_type == "stream":
            out[-1].text += output.text
        else:
            out.append(output)
    return out


if __name__ == "__main__":
    for path in [FOLDER / f"{name}.ipynb" for name in sys.argv[1:]] or sorted(FOLDER.glob("*.ipynb")):
        nbformat.write(stripped(executed(path)), path)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")
