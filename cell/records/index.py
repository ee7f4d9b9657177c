"""The SQLite index of a journal, opened to write or to read; used by one thread at a time."""

import json
import logging
import os
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from cell.records.kept_file import OWNER_ONLY
from cell.records.schema import (
    LOST,
    TABLES,
    ConfigRow,
    EventRow,
    RunRow,
    StageRow,
    create,
    is_present,
    names,
)
from cell.records.wall_clock import now_text
from drivers.errors import JournalError

logger = logging.getLogger(__name__)

Row = TypeVar("Row", RunRow, StageRow, EventRow, ConfigRow)

INDEX = "runs.sqlite"
OWNERS_FOLDER = 0o700
"""Permissions of a folder created for the journal."""
SET_ASIDE = "set-aside.jsonl"
"""Name of the file of rows that the index cannot store, one JSON object per line."""


def samples_path(folder: Path, run: int) -> Path:
    """Return the file of a run's samples."""
    return folder / f"run-{run:06d}.arrows"


def require_own(folder: Path) -> None:
    """Require that only its owner can write a journal's folder, if the folder exists.

    Files in the folder decide where the arm searches first and whether a start is safe.

    Raises:
        JournalError: Other users can write the folder.
    """
    with suppress(FileNotFoundError):
        # Permission bits that let users other than the owner write a folder.
        if (mode := folder.stat().st_mode) & 0o022:
            raise JournalError(
                f"{folder}: mode {mode & 0o777:o}: others than its owner may write the records; 700 to 755 allowed, as by chmod 700"
            )


class DamagedIndexError(JournalError):
    """The index is not an SQLite file, or is damaged."""


class BadRowError(JournalError):
    """SQLite refuses the content of a row; a retry does not help."""


_BAD_ROW = (
    sqlite3.IntegrityError,
    sqlite3.InterfaceError,
    sqlite3.DataError,
    sqlite3.ProgrammingError,
    OverflowError,
    UnicodeError,
)
"""Errors by which SQLite refuses the content of a row."""
_IF_SAME = (
    f"ON CONFLICT (run) DO UPDATE SET {', '.join(f'{name} = excluded.{name}' for name in names(RunRow)[1:])}"
    " WHERE started = excluded.started OR outcome = 'running'"
)
"""End of a statement that replaces the row of a run, but never the row of another run with the same number."""


class Index:
    """The rows of a journal."""

    def __init__(self, folder: Path, *, is_read_only: bool) -> None:
        """Open the index.

        When opened to write, create the index if it is missing. When opened to read, write nothing; a folder without an
        index then has no runs.

        Raises:
            DamagedIndexError: The index is not an SQLite file, or is damaged.
            JournalError: The index cannot be used, or another version of the program has written it.
        """
        self.path = folder / INDEX
        with self._told():
            self._connection = _opened_to_read(self.path) if is_read_only else _opened_to_write(self.path)
            self._file = self.path.stat().st_ino if self.path.exists() else 0
        # If a text is not valid UTF-8, its invalid bytes are replaced.
        self._connection.text_factory = lambda text: text.decode(errors="replace")
        self._set_aside: set[str] = set()

    def trace(self, say: Callable[[str], None] | None) -> None:
        """Call `say` with the text of every further statement, values included; None ends the tracing."""
        self._connection.set_trace_callback(say)

    def is_in_place(self) -> bool:
        """Return True if the path still names the opened file."""
        try:
            return self.path.stat().st_ino == self._file
        except OSError:
            return False

    def close(self) -> None:
        """Close; idempotent."""
        self._connection.close()

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Write everything in the `with` block as one transaction.

        Raises:
            JournalError: The index cannot be written.
        """
        with self._connection:  # rolls back after any exception, so that even an interrupt leaves no half transaction
            self.execute("BEGIN IMMEDIATE")
            yield
            self.execute("COMMIT")

    def rows(self, row: type[Row], where: str = "", values: Sequence[object] = ()) -> list[Row]:
        """Return the rows of a table that `where` selects; `values` replace its question marks."""
        found = self.execute(f"SELECT {', '.join(names(row))} FROM {TABLES[row]} {where}", values)
        return [row(*each) for each in found]

    def put(self, row: Any, *, how: str = "INSERT", then: str = "") -> bool:
        """Write a row; the index numbers an event. If the index refuses the row's content, set the row aside in a file.

        Args:
            row: The row.
            how: Beginning of the statement.
            then: End of the statement.

        Returns:
            True if the row is written.

        Raises:
            JournalError: The index cannot be written.
        """
        columns = names(type(row))[isinstance(row, EventRow) :]
        marks = ", ".join("?" * len(columns))
        try:
            self.execute(
                f"{how} INTO {TABLES[type(row)]} ({', '.join(columns)}) VALUES ({marks}) {then}",
                [getattr(row, name) for name in columns],
            )
        except BadRowError as error:
            self._put_aside(row, error)
            return False
        return True

    def _put_aside(self, row: Any, why: BadRowError) -> None:
        """Write a row once to a file that a person can read, and log it."""
        if (text := repr(row)) in self._set_aside:
            return
        self._set_aside.add(text)
        path = self.path.parent / SET_ASIDE
        told = {"time": now_text(), "why": str(why), "table": TABLES[type(row)], "row": asdict(row)}
        try:
            with os.fdopen(os.open(path, os.O_CREAT | os.O_APPEND | os.O_WRONLY, OWNER_ONLY), "a") as file:
                file.write(json.dumps(told, default=repr) + "\n")
        except OSError as error:
            logger.error("%s; it cannot be set aside either: %s", why, error)
        else:
            logger.error("%s; the row is set aside in %s", why, path)

    def put_ended(self, row: RunRow, stages: Sequence[StageRow]) -> None:
        """Write the end of a run and the tries of its stages.

        If the run's row cannot be written, record the run as lost.

        Raises:
            JournalError: The index cannot be written.
        """
        if not self.put(row, then=_IF_SAME):
            row = RunRow(
                row.run, row.started, "", 0, "", "", 0, LOST, message=f"its record is set aside in {SET_ASIDE}"
            )
            self.put(row, then=_IF_SAME)
        for stage in stages:
            self.put(stage, how="INSERT OR REPLACE")

    def execute(self, statement: str, values: Sequence[object] | dict[str, object] = ()) -> list[tuple[Any, ...]]:
        """Execute one statement and return the rows that it selects.

        Raises:
            BadRowError: The content of `values` cannot be written.
            DamagedIndexError: The index is damaged.
            JournalError: The index cannot be used.
        """
        with self._told():
            return self._connection.execute(statement, values).fetchall()

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except JournalError as error:
            raise JournalError(f"{self.path}: {error}") from None
        except _BAD_ROW as error:
            raise BadRowError(f"{self.path}: a row cannot be written: {error}") from None
        except (OSError, sqlite3.Error) as error:
            # A damaged file raises a plain DatabaseError; its subclasses mean locks, full disks and wrong statements.
            damaged = type(error) is sqlite3.DatabaseError
            raise (DamagedIndexError if damaged else JournalError)(f"{self.path}: cannot be used: {error}") from None


def _opened_to_write(path: Path) -> sqlite3.Connection:
    path.parent.mkdir(mode=OWNERS_FOLDER, parents=True, exist_ok=True)
    os.close(os.open(path, os.O_CREAT | os.O_RDWR, OWNER_ONLY))
    if path.stat().st_uid == os.geteuid():
        path.chmod(OWNER_ONLY)
    # Longest wait, s, if another program has locked the index.
    index = sqlite3.connect(path, timeout=1.0, isolation_level=None, check_same_thread=False)
    try:
        index.execute("PRAGMA synchronous=NORMAL")
        index.execute("PRAGMA journal_mode=WAL")
        create(index)
        # With FULL, a committed record survives a power failure.
        index.execute("PRAGMA synchronous=FULL")
    except (JournalError, sqlite3.Error):
        index.close()
        raise
    return index


def _opened_to_read(path: Path) -> sqlite3.Connection:
    """Return the index; if it is missing, return an empty one in memory."""
    if path.exists():
        index = _read_only(path)
        if is_present(index):
            return index
        index.close()
    empty = sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False)
    create(empty)
    return empty


def _read_only(path: Path) -> sqlite3.Connection:
    """Open an index for reading, even in a folder without write permission.

    To read an index in WAL mode, SQLite writes files beside the index unless the connection is declared immutable.
    """
    for mode in ("mode=ro", "mode=ro&immutable=1"):
        place = f"{path.absolute().as_uri()}?{mode}"
        index = sqlite3.connect(place, uri=True, timeout=10.0, isolation_level=None, check_same_thread=False)
        try:
            index.execute("SELECT count(*) FROM sqlite_master")
            index.execute("PRAGMA temp_store = MEMORY")  # a report needs no space on the disk
        except sqlite3.OperationalError:
            index.close()
        else:
            return index
    raise sqlite3.OperationalError("it cannot be read")
