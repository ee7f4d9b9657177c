"""The journal: runs, their stages, events and configs in an SQLite index, one stream of samples per run beside it."""

import os
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Self

from cell.journal_index import INDEX as INDEX
from cell.journal_index import Index
from cell.journal_schema import ConfigRow, EventRow, RunRow, StageRow
from cell.journal_told import Told, told_columns
from cell.provenance import versions
from cell.run_query import RunQuery
from drivers.errors import JournalError, UnknownRunError

if TYPE_CHECKING:
    from cell.journal_upkeep import Keep
    from cell.journal_writer import JournalWriter
    from cell.sample_blocks import SampleBlock
    from drivers.scene_facts import SceneFacts

MOST = 2**62
"""Number that exceeds the number of runs in any journal."""


def default_folder() -> Path:
    """Return the folder of the user's own data, which holds the journal."""
    base = os.environ.get("XDG_DATA_HOME")
    return (Path(base) if base else Path("~/.local/share").expanduser()) / "tactile-insertion-cell"


class Journal:
    """The records of a cell.

    A thread of its own writes the records, and callers never wait for it; a reader of the same object waits until they
    are written.
    """

    def __init__(self, folder: Path, *, is_read_only: bool = False, keep: "Keep | None" = None) -> None:
        """Keep the folder; `open` creates it.

        Args:
            folder: Folder of the index and the samples.
            is_read_only: Whether nothing is made, migrated or written; a folder without an index then has no runs.
            keep: Limits of age and size of the records; None keeps everything.
        """
        self.folder = folder
        self._is_read_only, self._keep = is_read_only, keep
        self._index: Index | None = None
        self._writer: JournalWriter | None = None

    def open(self) -> None:
        """Open the index; to write, make it where there is none and bring an earlier layout up to the present one.

        To write, runs that a killed program left open are closed, and an index that is torn is put aside and made again
        from the samples.

        Raises:
            JournalError: The folder or the index cannot be used, or a newer version of the program has made it.
        """
        if not self._is_read_only:
            # Arrow and the thread that writes, which whoever only asks for runs does not need.
            from cell.journal_upkeep import Keep
            from cell.journal_writer import JournalWriter

            versions()
            writer = JournalWriter(self.folder, self._keep or Keep())
            writer.open()
            self._writer = writer
        else:
            self._index = Index(self.folder, is_read_only=True)

    def close(self) -> None:
        """Write what waits and close; harmless when repeated."""
        index, self._index = self._index, None
        if index is not None:
            index.close()
        # The one that can write is the last: only it can put away what SQLite keeps beside the index.
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

    # Methods that write.

    def begin(self, row: RunRow, facts: "SceneFacts | None" = None) -> RunRow:
        """Put a run on record; return it with its number.

        Args:
            row: The run as it begins.
            facts: Facts of the scene for pictures of the run.

        Raises:
            JournalError: The journal is not open.
        """
        return self._writing().begin(row, facts)

    def write(self, run: int, block: "SampleBlock") -> None:
        """Put samples of a run on record.

        Raises:
            JournalError: The journal is not open.
        """
        self._writing().write(run, block)

    def finish(self, row: RunRow, stages: Sequence[StageRow] = (), rest: "SampleBlock | None" = None) -> None:
        """Put on record how a run and its stages ended, with the rest of its samples.

        Raises:
            JournalError: The journal is not open.
        """
        self._writing().finish(row, stages, rest)

    def note(self, row: EventRow) -> None:
        """Put an event on record; the index gives it its number.

        Raises:
            JournalError: The journal is not open.
        """
        self._writing().note(row)

    def keep_config(self, row: ConfigRow) -> None:
        """Keep a config whole, once.

        Raises:
            JournalError: The journal is not open.
        """
        self._writing().keep_config(row)

    @property
    def trouble(self) -> str:
        """Text that says what cannot be put on record now, and why; empty where all is well."""
        return "" if self._writer is None else self._writer.trouble

    @property
    def is_disk_low(self) -> bool:
        """Whether the disk has less free space than is asked for."""
        return self._writer is not None and self._writer.is_disk_low

    def _writing(self) -> "JournalWriter":
        if self._writer is None:
            raise JournalError(f"{self.folder / INDEX}: not open to write")
        return self._writer

    # Methods that read.

    def runs(self, last: int, since: str = "") -> list[RunRow]:
        """Return the newest runs, newest first, of those that started at the wall time `since`, ISO 8601 UTC, or later."""
        return self.select(RunQuery(since), last)

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
        """Return the number of the newest run; 0 when none is on record."""
        return int(self._reading().execute("SELECT coalesce(max(run), 0) FROM runs", [])[0][0])

    def outcomes(self, query: RunQuery) -> dict[str, int]:
        """Return the number of runs of each outcome, of those that a question is about."""
        where, values = query.where()
        counted = f"SELECT outcome, count(*) FROM runs WHERE {where} GROUP BY outcome"
        return dict(self._reading().execute(counted, values))

    def stages(self, run: int) -> list[StageRow]:
        """Return the stages of a run in the order in which they were tried."""
        return self._reading().rows(StageRow, "WHERE run = ? ORDER BY place", [run])

    def select(self, query: RunQuery, last: int = MOST) -> list[RunRow]:
        """Return the newest runs that a question is about, newest first."""
        where, values = query.where()
        return self._reading().rows(RunRow, f"WHERE {where} ORDER BY run DESC LIMIT ?", [*values, last])

    def told(self, query: RunQuery) -> Told:
        """Return what a report tells of the runs that a question is about, as far as they have ended."""
        where, values = query.where()
        asked = f"FROM runs JOIN told USING (run) WHERE {where} AND outcome != 'running' ORDER BY started"
        return told_columns(self._reading().execute(f"SELECT kind, figures {asked}", values))

    def events(self, since: str = "", run: int | None = None) -> list[EventRow]:
        """Return the events, oldest first, from the wall time `since`, ISO 8601 UTC, on; of one run where it is named."""
        if run is not None:
            return self._reading().rows(EventRow, "WHERE time >= ? AND run = ? ORDER BY event", [since, run])
        return self._reading().rows(EventRow, "WHERE time >= ? ORDER BY event", [since])

    def config(self, digest: str) -> str | None:
        """Return the config that runs name by its digest, as JSON; None where it was not kept."""
        found = self._reading().rows(ConfigRow, "WHERE config_hash = ?", [digest])
        return found[0].config if found else None

    def samples_path(self, run: int) -> Path:
        """Return the file of a run's samples."""
        return self.folder / f"run-{run:06d}.arrows"

    def _reading(self) -> Index:
        """Return the index to read, with all in it that was put on record before."""
        if self._writer is not None:
            self._writer.flush()
            if self._index is not None and not self._index.is_in_place():
                # Somebody deleted it, or it was torn and has been made again.
                self._index.close()
                self._index = None
            if self._index is None:
                self._index = Index(self.folder, is_read_only=True)
        if self._index is None:
            raise JournalError(f"{self.folder / INDEX}: not open")
        return self._index


def newest_run(folder: Path, *, is_simulated: bool) -> RunRow | None:
    """Return the newest run of a simulated cell, or of a real one, that is on record in a folder; None if there is none.

    Raises:
        JournalError: The index cannot be read.
    """
    with closing(Index(folder, is_read_only=True)) as index:
        found = index.rows(RunRow, "WHERE is_simulated = ? ORDER BY run DESC LIMIT 1", [int(is_simulated)])
    return found[0] if found else None
