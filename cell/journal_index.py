"""The SQLite index of a journal: opened to write or to read, one statement after the other; used by one thread at a time."""

import json
import logging
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from cell.journal_schema import (
    LAYOUT,
    LOST,
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
from cell.wall_clock import now_text
from drivers.errors import JournalError

logger = logging.getLogger(__name__)

Row = TypeVar("Row", RunRow, StageRow, EventRow, ConfigRow)

INDEX = "runs.sqlite"
OWNER_ONLY, OWNERS_FOLDER = 0o600, 0o700
"""Permissions of the journal's files and of a folder that is made for them."""
OTHERS_WRITE = 0o022
"""Permissions by which others than its owner may write a folder."""
SET_ASIDE = "set-aside.jsonl"
"""Name of the file of rows whose content the index cannot hold, one JSON object a line."""
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


class BadRowError(JournalError):
    """The content of a row cannot be written, however often it is tried."""


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
"""End of a statement that replaces the row of a run, but never that of another run which has its number."""


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
        # Text that is no UTF-8 is shown as far as it goes.
        self._connection.text_factory = lambda text: text.decode(errors="replace")
        self._set_aside: set[str] = set()

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
        found = self.execute(f"SELECT {', '.join(names(row))} FROM {TABLES[row]} {where}", values or [])
        return [row(*each) for each in found]

    def put(self, row: Any, *, is_numbered_here: bool = False, how: str = "INSERT", then: str = "") -> bool:
        """Write a row; a row whose content cannot be written is set aside in a file, and everything else goes on.

        Args:
            row: The row.
            is_numbered_here: True if the index counts up the number in the first column.
            how: Beginning of the statement.
            then: End of the statement.

        Returns:
            True if the row is written.

        Raises:
            JournalError: The index cannot be written.
        """
        columns = names(type(row))[is_numbered_here:]
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
        """Write a row where a person can read it, once, and say so."""
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
        """Write how a run and the tries of its stages ended, and what reports tell of it.

        A run whose row cannot be written is recorded as lost.

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
        self.put(told_row(row, stages), how="INSERT OR REPLACE")

    def execute(self, statement: str, values: list[object]) -> list[tuple[Any, ...]]:
        """Execute one statement and return the rows that it selects.

        Raises:
            BadRowError: The content of `values` cannot be written.
            DamagedIndexError: The index is torn.
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
