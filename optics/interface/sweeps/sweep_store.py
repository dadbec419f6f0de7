"""The file that holds every variant that was ever computed in a folder: SQLite, one row for a problem.

Only the process that runs the sweep writes to it.  A row is whole or absent, also where that process is
killed: SQLite's log is written ahead.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from optics.base.runtime import UserError
from optics.interface.sweeps.sweep_rows import DONE, SweepRow
from thbcad import __version__

SCHEMA, VERSION = "thbcad-sweep", 1
BATCH, BATCH_SECONDS = 100, 0.5  # rows, and seconds of their work, to a commit: each waits for the disk
TABLES = """
CREATE TABLE IF NOT EXISTS about (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS variants (
    problem TEXT PRIMARY KEY, changes TEXT NOT NULL, status TEXT NOT NULL, sentence TEXT NOT NULL,
    metrics TEXT NOT NULL, seconds REAL NOT NULL, peak_mb REAL NOT NULL, picture BLOB NOT NULL,
    lens TEXT NOT NULL
);
"""
COLUMNS = "status, sentence, metrics, seconds, peak_mb, picture"


class SweepStore:
    """The rows of one sweep."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self._path, self._connection, self._file = path, connection, path.stat()
        self._waiting, self._seconds = 0, 0.0

    def problems(self) -> set[str]:
        """Return the fingerprints of the problems that are stored."""
        return {row[0] for row in self._connection.execute("SELECT problem FROM variants")}

    def done(self, with_lens: bool) -> set[str]:
        """Return the fingerprints of the problems that are designed.  with_lens : whose lens is kept too."""
        rows = self._connection.execute(
            "SELECT problem FROM variants WHERE status = ? AND (lens != '' OR NOT ?)", (DONE, with_lens)
        )
        return {row[0] for row in rows}

    def get(self, problem: str, values: tuple[Any, ...] = ()) -> SweepRow | None:
        """Return the row of a problem.  values : of the varied keys, which the row is to have."""
        row = self._connection.execute(
            f"SELECT {COLUMNS} FROM variants WHERE problem = ?", (problem,)
        ).fetchone()
        if row is None:
            return None
        status, sentence, metrics, seconds, peak_mb, picture = row
        return SweepRow(values, status, sentence, json.loads(metrics), seconds, peak_mb, picture)

    def add(self, problem: str, changes: Mapping[str, Any], row: SweepRow, lens: str = "") -> None:
        """Store a row; it is on the disk after the next commit, until which half a second of work may wait.

        A variant that is designed stays so where another try, for its lens, fails.
        """
        held = None if row.status == DONE else self.get(problem)
        if held is not None and held.status == DONE:
            return
        metrics = json.dumps(row.metrics)
        known = (row.status, row.sentence, metrics, row.seconds, row.peak_mb, row.picture)
        values = (problem, json.dumps(dict(changes)), *known, lens)
        marks = ", ".join("?" * len(values))
        self._connection.execute(f"INSERT OR REPLACE INTO variants VALUES ({marks})", values)
        self._waiting, self._seconds = self._waiting + 1, self._seconds + row.seconds
        if self._waiting >= BATCH or self._seconds >= BATCH_SECONDS:
            self.commit()

    def commit(self) -> None:
        """Bring what waits to the disk, into the file that was opened: one without a name could be filled on.

        Raises UserError : the file was removed or moved.
        """
        self._connection.commit()
        self._waiting, self._seconds = 0, 0.0
        with suppress(OSError):
            if os.path.samestat(self._path.stat(), self._file):
                return
        raise UserError(
            f"{self._path} was removed or moved while the sweep ran; bring it back and go on with --resume, "
            "or run the sweep again in a folder that stays"
        )


@contextmanager
def open_store(path: Path, sweep: Mapping[str, str]) -> Iterator[SweepStore]:
    """Yield the store of a sweep; it is made where there is none.

    sweep : what tells it from other sweeps, texts by name.

    Raises UserError : the file belongs to another sweep or version, is damaged, or the disk is full; it was
        removed or moved, whatever else ends the block then.
    """
    try:
        connection = sqlite3.connect(path)
        try:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.executescript(TABLES)
            _require_same(path, connection, sweep)
            store = SweepStore(path, connection)
            try:
                yield store
            finally:
                store.commit()
        finally:
            connection.close()
    except sqlite3.Error as error:
        raise UserError(
            f"cannot use {path}: {error}; see that the disk has room and that nobody else writes there, or "
            "begin anew with --force"
        ) from None


def _require_same(path: Path, connection: sqlite3.Connection, sweep: Mapping[str, str]) -> None:
    """Write what the sweep is, or compare it with what the file says."""
    wanted = {"schema": SCHEMA, "version": str(VERSION), "thbcad": __version__, **sweep}
    held = dict(connection.execute("SELECT key, value FROM about"))
    if not held or connection.execute("SELECT 1 FROM variants").fetchone() is None:
        connection.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", wanted.items())
        connection.commit()
        return
    differing = [key for key in wanted if held.get(key) != wanted[key]]
    if differing:
        raise UserError(
            f"{path.parent} holds another sweep (it differs in {', '.join(differing)}); choose another "
            "--out, or drop it with --force"
        )
