"""What happened: one row per run in an SQLite index, one stream of samples per run beside it."""

import hashlib
import json
import os
import sqlite3
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Self

from drivers.errors import JournalError

if TYPE_CHECKING:
    from cell.config import CellConfig
    from cell.samples import SampleStream
    from drivers.scene_facts import SceneFacts

INDEX = "runs.sqlite"
PACKAGES = ("tactile-insertion-cell", "mujoco", "numpy", "numba", "opencv-contrib-python-headless", "pymodbus")
"""Their versions stand in each record."""
OWN = ("cell", "drivers", "plc_bridge", "sim", "skills")
"""Packages of this program."""


@dataclass(frozen=True, slots=True)
class RunRow:
    """One run, as the index has it."""

    run: int
    started: str
    """Wall time, ISO 8601, UTC."""
    program: str
    recipe: int
    serial: str
    source: str
    """Who asked: address, node or user."""
    sequence: int
    """Of the PLC's command."""
    outcome: str = "running"
    """`success`, `failure`, `aborted`, `fault`; `running` also when the program was killed meanwhile."""
    stage: str = ""
    """Skill that was reached last."""
    reason: str = ""
    fault: int = 0
    message: str = ""
    """Of the fault."""
    stage_times: str = "[]"
    """JSON, list of [skill, s]."""
    versions: str = "{}"
    """JSON, package to version."""
    config_hash: str = ""


_NAMES = tuple(field.name for field in fields(RunRow))
_TYPES = {int: "INTEGER", str: "TEXT"}
_CREATE = "CREATE TABLE IF NOT EXISTS runs (run INTEGER PRIMARY KEY AUTOINCREMENT, {})".format(
    ", ".join(f"{field.name} {_TYPES[field.type]} NOT NULL" for field in fields(RunRow)[1:])  # type: ignore[index]
)


def default_folder() -> Path:
    """Return the journal's folder among the user's own data."""
    base = os.environ.get("XDG_DATA_HOME")
    return (Path(base) if base else Path("~/.local/share").expanduser()) / "tactile-insertion-cell"


class Journal:
    """The records of a cell; used by one thread."""

    def __init__(self, folder: Path) -> None:
        """Keep the folder; `open` creates it."""
        self.folder = folder
        self._index: sqlite3.Connection | None = None

    def open(self) -> None:
        """Open the index, and make it where there is none.

        Raises:
            JournalError: The folder or the index cannot be used.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._index = sqlite3.connect(self.folder / INDEX, timeout=10.0, isolation_level=None)
            self._index.execute("PRAGMA journal_mode=WAL")
            self._index.execute(_CREATE)
        except (OSError, sqlite3.Error) as error:
            self.close()
            raise JournalError(f"{self.folder / INDEX}: cannot be used: {error}") from None

    def close(self) -> None:
        """Close the index; harmless when repeated."""
        if self._index is not None:
            self._index.close()
            self._index = None

    def __enter__(self) -> Self:
        """Open."""
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def begin(self, row: RunRow) -> RunRow:
        """Put a run on record before it moves anything; return it with its number.

        Raises:
            JournalError: The index cannot be written.
        """
        columns = ", ".join(_NAMES[1:])
        marks = ", ".join("?" * (len(_NAMES) - 1))
        cursor = self._execute(
            f"INSERT INTO runs ({columns}) VALUES ({marks})",
            [getattr(row, name) for name in _NAMES[1:]],
        )
        return replace(row, run=int(cursor.lastrowid or 0))

    def finish(self, row: RunRow) -> None:
        """Put on record how a run ended.

        Raises:
            JournalError: The index cannot be written.
        """
        places = ", ".join(f"{name} = ?" for name in _NAMES[1:])
        self._execute(
            f"UPDATE runs SET {places} WHERE run = ?", [*(getattr(row, name) for name in _NAMES[1:]), row.run]
        )

    def runs(self, last: int) -> list[RunRow]:
        """Return the newest runs, newest first."""
        cursor = self._execute(f"SELECT {', '.join(_NAMES)} FROM runs ORDER BY run DESC LIMIT ?", [last])
        return [RunRow(*values) for values in cursor]

    def find(self, run: int) -> RunRow:
        """Return one run.

        Raises:
            JournalError: It is not on record.
        """
        cursor = self._execute(f"SELECT {', '.join(_NAMES)} FROM runs WHERE run = ?", [run])
        values = cursor.fetchone()
        if values is None:
            last = self.last_run()
            known = f"1 to {last} are on record" if last else "no runs are on record yet"
            raise JournalError(f"run {run}: not in {self.folder / INDEX}; {known}")
        return RunRow(*values)

    def last_run(self) -> int:
        """Return the number of the newest run; 0 when none is on record."""
        return int(self._execute("SELECT coalesce(max(run), 0) FROM runs", []).fetchone()[0])

    def samples_path(self, run: int) -> Path:
        """Return where the samples of a run are."""
        return self.folder / f"run-{run:06d}.arrows"

    def stream(self, run: int, facts: "SceneFacts | None" = None) -> "SampleStream":
        """Start the stream of samples of a run, with what a picture of it has to know.

        Raises:
            JournalError: The file cannot be written.
        """
        from cell.samples import SampleStream  # Arrow, which who only asks for runs does not need

        return SampleStream(self.samples_path(run), facts)

    def _execute(self, statement: str, values: list[object]) -> sqlite3.Cursor:
        if self._index is None:
            raise JournalError(f"{self.folder / INDEX}: not open")
        try:
            return self._index.execute(statement, values)
        except sqlite3.Error as error:
            raise JournalError(f"{self.folder / INDEX}: cannot be used: {error}") from None


def now_text() -> str:
    """Return the wall time as records have it."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


@lru_cache
def versions() -> dict[str, str]:
    """Return the versions that a record names, and a fingerprint of this program's own code and arms."""
    return {**{name: _version(name) for name in PACKAGES}, "code": _code_hash()}


def config_hash(config: "CellConfig") -> str:
    """Return a short fingerprint of a whole config."""
    text = json.dumps(config.model_dump(mode="json"), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _code_hash() -> str:
    root = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for package in OWN:
        for file in sorted((root / package).rglob("*.py")):
            digest.update(file.read_bytes())
    for file in sorted((root / "config" / "arms").glob("*.toml")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
