"""The folder of a sweep: whose it is, and the files that show it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from optics.base.runtime import UserError
from optics.exchange.results import (
    fingerprint,
    recorded,
    require_own,
    require_places,
    run_lock,
    writable_folder,
    write_recorded,
)
from optics.interface.sweeps.sweep_rows import Sweep, csv_text, parquet_bytes
from optics.interface.sweeps.sweep_store import SweepStore, open_store
from optics.interface.sweeps.sweep_views import contact_sheet, metric_plots, plot_name, sweep_page
from optics.scene.problem import Problem

STORE = "sweep.sqlite"
RECORD = "sweep.json"
TABLE, PARQUET, PAGE, SHEET = "sweep.csv", "sweep.parquet", "sweep.html", "contact_sheet.png"
FILES = (RECORD, TABLE, PARQUET, PAGE, SHEET)


@contextmanager
def taken_folder(
    folder: Path, problem: Problem, keys: Sequence[str], resume: bool, force: bool
) -> Iterator[SweepStore]:
    """Hold the folder for one run of a sweep, and yield its store.

    Raises UserError : it cannot be written, another run writes to it, it holds another sweep or files of
        others, or there is nothing to resume.
    """
    if resume and not (folder / STORE).exists():
        raise UserError(f"nothing to resume: there is no {folder / STORE}; run without --resume")
    try:
        identity = fingerprint(problem)
    except OSError as error:
        raise UserError(
            f"cannot read {error.filename}: {error.strerror}; a sweep needs it also where it is varied"
        ) from None
    new = not folder.exists()
    writable_folder(folder)
    try:
        with run_lock(folder, problem.title):
            require_places(folder, [*FILES, plot_name("any")])
            try:
                require_own(folder, _replaceable(folder), RECORD, force)
            except UserError as error:
                kept = "; with --resume too, what is computed stays" if (folder / STORE).exists() else ""
                raise UserError(f"{error}{kept}") from None
            if force and not resume:
                _drop(folder)
            with _begun_store(folder, {"problem": identity, "keys": ", ".join(keys)}) as store:
                yield store
    finally:
        if new:
            with suppress(OSError):  # something is in it
                folder.rmdir()


@contextmanager
def _begun_store(folder: Path, own: Mapping[str, str]) -> Iterator[SweepStore]:
    """Yield the store of a sweep; one that was not there before and stays empty is removed."""
    unneeded = new = not (folder / STORE).exists()
    try:
        with open_store(folder / STORE, own) as store:
            unneeded = False
            try:
                yield store
            finally:
                unneeded = new and not store.problems()
    finally:
        if unneeded:
            _drop(folder)


def _replaceable(folder: Path) -> list[str]:
    """Return the names of files that a sweep may replace: every picture there may be the plot of a metric."""
    return [*FILES, *sorted(f"figures/{path.name}" for path in (folder / "figures").glob("*.png"))]


def _drop(folder: Path) -> None:
    """Remove the store, and what SQLite keeps beside it."""
    for end in ("", "-wal", "-shm"):
        (folder / f"{STORE}{end}").unlink(missing_ok=True)


def write_sweep(sweep: Sweep, title: str) -> None:
    """Write tables, plots, contact sheet and page, and the record of these files.

    What an earlier sweep wrote and this one does not is removed: it would show other variants.
    """
    plots, folder = metric_plots(sweep), sweep.folder
    contents: dict[str, bytes | None] = {
        TABLE: csv_text(sweep).encode(),
        PARQUET: parquet_bytes(sweep),
        SHEET: contact_sheet(sweep),
        PAGE: sweep_page(sweep, title, plots).encode(),
    }
    contents |= {plot_name(metric): png for metric, png in plots.items()}
    written = {name: data for name, data in contents.items() if data is not None}
    (folder / "figures").mkdir(exist_ok=True)
    earlier = recorded(folder / RECORD).keys() & _replaceable(folder)
    data = {"schema": "thbcad-sweep-files", "version": 1}
    write_recorded(folder, RECORD, data, written, earlier - written.keys())
