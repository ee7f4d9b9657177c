"""The SQLite index of a journal: opened to write or to read, one statement after the other; used by one thread at a time."""

import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from cell.journal_schema import (
    LAYOUT,
    TABLES,
    ConfigRow,
    EventRow,
    RunRow,
    StageRow,
    migrate,
    names,
    require_known_layout,
)
from cell.journal_told import told_row
from drivers.errors import JournalError

Row = TypeVar("Row", RunRow, StageRow, EventRow, ConfigRow)

INDEX = "runs.sqlite"
OWNER_ONLY, OWNERS_FOLDER = 0o600, 0o700
"""Permissions of the journal's files and of a folder that is made for them."""
OTHERS_WRITE = 0o022
"""Permissions by which others than its owner may write a folder."""
LOCK_TIMEOUT = 1.0
"""Time that a statement waits for an index which another program has locked, s."""


def require_own(folder: Path) -> None:
    """Make sure that only its owner may write a journal's folder, if there is one yet.

    What lies in it decides where the arm searches first and whether a start is safe, so that whoever writes it moves the cell.

    Raises:
        JournalError: Others may write it.
    """
    with suppress(FileNotFoundError):
        if (mode := folder.stat().st_mode) & OTHERS_WRITE:
            raise JournalError(
                f"{folder}: mode {mode & 0o777:o}: others than its owner may write the records; 700 to 755 allowed, as by chmod 700"
            )


class DamagedIndexError(JournalError):
    """The index is no SQLite file, or is torn."""


class Index:
    """The rows of a journal."""

    def __init__(self, folder: Path, *, is_read_only: bool) -> None:
        """Open the index; to write, make it where there is none and bring an earlier layout up to the present one.

        To read, nothing is made, migrated or written; a folder without an index has no runs.

        Raises:
            DamagedIndexError: The index is no SQLite file, or is torn.
            JournalError: The index cannot be used, or a newer version of the program has made it.
        """
        self.path = folder / INDEX
        with self._told():
            self._connection = _opened_to_read(self.path) if is_read_only else _opened_to_write(self.path)
            self._file = self.path.stat().st_ino if self.path.exists() else 0

    def is_in_place(self) -> bool:
        """Tell whether the file that was opened is still the one under its name."""
        try:
            return self.path.stat().st_ino == self._file
        except OSError:
            return False

    def close(self) -> None:
        """Close; harmless when repeated."""
        self._connection.close()

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Make all that is written meanwhile one transaction, which fails as a whole.

        Raises:
            JournalError: The index cannot be written.
        """
        self.execute("BEGIN IMMEDIATE", [])
        try:
            yield
            self.execute("COMMIT", [])
        except BaseException:  # an interrupt as well must not leave half a transaction; it is raised again
            with suppress(sqlite3.Error):
                self._connection.execute("ROLLBACK")
            raise

    def rows(self, row: type[Row], where: str = "", values: list[object] | None = None) -> list[Row]:
        """Return the rows of a table that `where`, with `values` in the places of its question marks, selects."""
        cursor = self.execute(f"SELECT {', '.join(names(row))} FROM {TABLES[row]} {where}", values or [])
        return [row(*found) for found in cursor]

    def put(self, row: Any, *, is_numbered_here: bool = False, how: str = "INSERT") -> None:
        """Write a row; where `is_numbered_here`, the index counts up the number in its first column.

        Raises:
            JournalError: The index cannot be written.
        """
        columns = names(type(row))[is_numbered_here:]
        marks = ", ".join("?" * len(columns))
        self.execute(
            f"{how} INTO {TABLES[type(row)]} ({', '.join(columns)}) VALUES ({marks})",
            [getattr(row, name) for name in columns],
        )

    def put_ended(self, row: RunRow, stages: Sequence[StageRow]) -> None:
        """Write the tries of the stages of a run that has ended, and what reports tell of it.

        Raises:
            JournalError: The index cannot be written.
        """
        for stage in stages:
            self.put(stage, how="INSERT OR REPLACE")
        self.put(told_row(row, stages), how="INSERT OR REPLACE")

    def execute(self, statement: str, values: list[object]) -> sqlite3.Cursor:
        """Execute one statement.

        Raises:
            DamagedIndexError: The index is torn.
            JournalError: The index cannot be used.
        """
        with self._told():
            return self._connection.execute(statement, values)

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except JournalError as error:
            raise JournalError(f"{self.path}: {error}") from None
        except (OSError, sqlite3.Error) as error:
            # A torn file is a plain DatabaseError; its subclasses tell of locks, full disks and wrong statements.
            damaged = type(error) is sqlite3.DatabaseError
            raise (DamagedIndexError if damaged else JournalError)(f"{self.path}: cannot be used: {error}") from None


def _opened_to_write(path: Path) -> sqlite3.Connection:
    path.parent.mkdir(mode=OWNERS_FOLDER, parents=True, exist_ok=True)
    os.close(os.open(path, os.O_CREAT | os.O_RDWR, OWNER_ONLY))
    if path.stat().st_uid == os.geteuid():
        path.chmod(OWNER_ONLY)
    index = sqlite3.connect(path, timeout=LOCK_TIMEOUT, isolation_level=None, check_same_thread=False)
    try:
        index.execute("PRAGMA synchronous=NORMAL")
        index.execute("PRAGMA journal_mode=WAL")
        migrate(index, _tell_all)
        # What is told to be on record is on the disk, also when the power fails.
        index.execute("PRAGMA synchronous=FULL")
    except (JournalError, sqlite3.Error):
        index.close()
        raise
    return index


def _tell_all(index: sqlite3.Connection) -> None:
    """Tell of every run that has ended and is not told of yet, as in an index of an earlier layout.

    Raises:
        sqlite3.Error: The index cannot be written.
    """
    wanted = "FROM runs WHERE outcome != 'running' AND run NOT IN (SELECT run FROM told)"
    for values in index.execute(f"SELECT {', '.join(names(RunRow))} {wanted}").fetchall():
        row = RunRow(*values)
        tries = index.execute(
            f"SELECT {', '.join(names(StageRow))} FROM stages WHERE run = ? ORDER BY place", [row.run]
        )
        told = told_row(row, [StageRow(*found) for found in tries])
        index.execute("INSERT INTO told VALUES (?, ?, ?)", [told.run, told.kind, told.figures])


def _opened_to_read(path: Path) -> sqlite3.Connection:
    """Return the index, or a copy in memory in the present layout of one that has an earlier layout or none."""
    copy = sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False)
    if path.exists():
        index = _read_only(path)
        if require_known_layout(index) == LAYOUT:
            return index
        index.backup(copy)
        index.close()
    migrate(copy, _tell_all)
    return copy


def _read_only(path: Path) -> sqlite3.Connection:
    """Return an index to read, also one in a folder where nothing can be written.

    SQLite needs to write beside an index in WAL mode even to read it, unless it is told that nobody changes it.
    """
    for mode in ("mode=ro", "mode=ro&immutable=1"):
        place = f"{path.absolute().as_uri()}?{mode}"
        index = sqlite3.connect(place, uri=True, timeout=10.0, isolation_level=None, check_same_thread=False)
        try:
            index.execute("SELECT count(*) FROM sqlite_master")
        except sqlite3.OperationalError:
            index.close()
        else:
            return index
    raise sqlite3.OperationalError("it cannot be read")
