"""The journal: an SQLite index of runs, stages, events and configs, and one file of samples per run."""

import os
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from cell.records.alarms import ALARMS, Alarm
from cell.records.index import INDEX as INDEX
from cell.records.index import Index, samples_path
from cell.records.provenance import versions
from cell.records.run_query import NEVER, RunQuery
from cell.records.schema import ConfigRow, EventRow, RunRow, StageRow
from drivers.errors import JournalError, UnknownRunError

if TYPE_CHECKING:
    from cell.config.cell_config import JournalConfig
    from cell.records.writer import JournalWriter


def default_folder() -> Path:
    """Return the folder of the journal, in the user's data folder."""
    base = os.environ.get("XDG_DATA_HOME")
    return (Path(base) if base else Path("~/.local/share").expanduser()) / "tactile-insertion-cell"


class Journal:
    """The records of a cell.

    A separate thread writes the records, so that callers never wait. Reading methods of the same object wait until
    all records are written.
    """

    def __init__(
        self,
        folder: Path,
        *,
        is_read_only: bool = False,
        keep: "JournalConfig | None" = None,
        trace: Callable[[str], None] | None = None,
    ) -> None:
        """Keep the folder; `open` creates it.

        Args:
            folder: Folder of the index and the samples.
            is_read_only: True to create and write nothing; a folder without an index then has no runs.
            keep: Limits of age and size of the records; None keeps all of them.
            trace: Function that is called with each SQL statement of a journal that is only read.
        """
        self.folder = folder
        self._is_read_only, self._keep, self._trace = is_read_only, keep, trace
        self._index: Index | None = None
        self._writer: JournalWriter | None = None

    def open(self) -> None:
        """Open the index.

        When opened to write, the journal creates a missing index. It closes the runs that
        a killed program left open. If the index is damaged, the journal sets it aside and rebuilds it from the samples.

        Raises:
            JournalError: The folder or the index cannot be used, or another version of the program has written it.
        """
        if not self._is_read_only:
            # Imported here because a reader of runs needs neither Arrow nor the writing thread.
            from cell.config.cell_config import JournalConfig
            from cell.records.writer import JournalWriter

            versions()
            writer = JournalWriter(self.folder, self._keep or JournalConfig())
            writer.open()
            self._writer = writer
        else:
            self._index = Index(self.folder, is_read_only=True)
            self._index.trace(self._trace)

    def close(self) -> None:
        """Write the waiting records and close; idempotent."""
        index, self._index = self._index, None
        if index is not None:
            index.close()
        # Close the writing connection last: only it can remove SQLite's files beside the index.
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()

    def __enter__(self) -> Self:
        """Open."""
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    @property
    def writer(self) -> "JournalWriter":
        """The writing side of the journal.

        Raises:
            JournalError: The journal is not open to write.
        """
        if self._writer is None:
            raise JournalError(f"{self.folder / INDEX}: not open to write")
        return self._writer

    @property
    def trouble(self) -> str:
        """Records that cannot be written now, and the reason; empty without trouble."""
        return "" if self._writer is None else self._writer.trouble

    @property
    def is_disk_low(self) -> bool:
        """True if the free space of the disk is below `JournalConfig.least_free`."""
        return self._writer is not None and self._writer.is_disk_low

    # Methods that read.

    def runs(self, last: int) -> list[RunRow]:
        """Return the newest `last` runs, newest first."""
        return self.select(RunQuery(), last)

    def find(self, run: int) -> RunRow:
        """Return one run.

        Raises:
            UnknownRunError: The run is not on record.
        """
        found = self._reading().rows(RunRow, "WHERE run = ?", [run])
        if not found:
            last = self.last_run()
            known = f"1 to {last} are on record" if last else "no runs are on record yet"
            raise UnknownRunError(f"run {run}: not in {self.folder / INDEX}; {known}")
        return found[0]

    def last_run(self) -> int:
        """Return the number of the newest run; 0 if none is on record."""
        return int(self._reading().execute("SELECT coalesce(max(run), 0) FROM runs")[0][0])

    def outcomes(self, query: RunQuery) -> dict[str, int]:
        """Return the number of runs of each outcome, among the runs that a query selects."""
        where, values = query.where()
        counted = f"SELECT outcome, count(*) FROM runs WHERE {where} GROUP BY outcome"
        return dict(self._reading().execute(counted, values))

    def stages(self, run: int) -> list[StageRow]:
        """Return the stages of a run, in the order of their tries."""
        return self._reading().rows(StageRow, "WHERE run = ? ORDER BY place", [run])

    def select(self, query: RunQuery, last: int = -1) -> list[RunRow]:
        """Return the newest `last` runs that a query selects, newest first; a negative number returns all."""
        where, values = query.where()
        return self._reading().rows(RunRow, f"WHERE {where} ORDER BY run DESC LIMIT ?", [*values, last])

    def ask(self, statement: str, values: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        """Execute an SQL statement on the index, which is read only, and return the rows that it selects."""
        return self._reading().execute(statement, values)

    def alarms(self, last: int, since: str = "", until: str = "", code: int | None = None) -> list[Alarm]:
        """Return the newest `last` alarms that came in a period, ISO 8601 UTC, newest first; with `code`, of one fault only."""
        values: dict[str, object] = {"last": last, "since": since, "until": until or NEVER, "code": code}
        return [Alarm(*row) for row in self._reading().execute(ALARMS, values)]

    def events(self, run: int | None = None) -> list[EventRow]:
        """Return the events, oldest first; with `run`, only those of this run."""
        if run is not None:
            return self._reading().rows(EventRow, "WHERE run = ? ORDER BY event", [run])
        return self._reading().rows(EventRow, "ORDER BY event")

    def config(self, digest: str) -> str | None:
        """Return the config with a digest, as JSON; None if it is not on record."""
        found = self._reading().rows(ConfigRow, "WHERE config_hash = ?", [digest])
        return found[0].config if found else None

    def samples_path(self, run: int) -> Path:
        """Return the file of a run's samples."""
        return samples_path(self.folder, run)

    def _reading(self) -> Index:
        """Return the index for reading, after all earlier records are written."""
        if self._writer is not None:
            self._writer.flush()
            if self._index is not None and not self._index.is_in_place():
                # The index was deleted, or it was damaged and rebuilt.
                self._index.close()
                self._index = None
            if self._index is None:
                self._index = Index(self.folder, is_read_only=True)
        if self._index is None:
            raise JournalError(f"{self.folder / INDEX}: not open")
        return self._index


def newest_run(folder: Path, *, is_simulated: bool) -> RunRow | None:
    """Return the newest recorded run of a simulated or real cell in a folder; None if there is none.

    Raises:
        JournalError: The index cannot be read.
    """
    with closing(Index(folder, is_read_only=True)) as index:
        found = index.rows(RunRow, "WHERE is_simulated = ? ORDER BY run DESC LIMIT 1", [int(is_simulated)])
    return found[0] if found else None
