"""Files of samples of the open runs, for the journal's thread; if a file fails, its run continues without samples."""

import logging
import os
import shutil
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from cell.records.index import samples_path
from cell.records.kept_file import OWNER_ONLY
from cell.records.sample_blocks import SampleBlock
from cell.records.samples import SampleFile
from cell.records.schema import RunRow, StageRow
from cell.records.upkeep import beginning_text, ending_text
from drivers.errors import JournalError
from drivers.scene_facts import SceneFacts

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class _OpenRun:
    """The samples of one open run."""

    file: SampleFile | None = None
    written: int = 0
    """Number of scans on the disk."""
    is_whole: bool = True
    """True if no scan was lost."""


class RunSamples:
    """The samples of the open runs; only the writing thread may call its methods, except `lose`."""

    def __init__(self, folder: Path, least_free: int) -> None:
        """Keep the folder, and the required free space of the disk, bytes."""
        self._folder, self._least_free = folder, least_free
        self._runs: dict[int, _OpenRun] = {}
        self.trouble = ""
        """Reason why samples are not written; empty without trouble."""

    @property
    def under_way(self) -> Collection[int]:
        """Numbers of the open runs."""
        return self._runs.keys()

    def claim(self, after: int) -> int:
        """Return the next free number above `after`; the file of its samples reserves it against other programs.

        Raises:
            OSError: The file cannot be created.
        """
        number = after
        while True:
            number += 1
            try:
                os.close(os.open(samples_path(self._folder, number), os.O_CREAT | os.O_EXCL | os.O_RDWR, OWNER_ONLY))
            except FileExistsError:
                continue
            return number

    def give_back(self, number: int) -> None:
        """Delete the file of a reserved number that is not used."""
        with suppress(OSError):
            samples_path(self._folder, number).unlink()

    def begin(self, row: RunRow, facts: SceneFacts | None) -> None:
        """Start the file of a run."""
        run = self._runs[row.run] = _OpenRun()
        path = samples_path(self._folder, row.run)
        try:
            if self._is_too_full():
                raise JournalError(f"{path}: not written: the disk is all but full")
            run.file = SampleFile(path, facts, beginning_text(row))
        except (JournalError, OSError) as error:
            self._give_up(row.run, error)

    def write(self, number: int, block: SampleBlock, ending: str = "") -> None:
        """Write a block of a run; `ending` is the text of the run's end, for the last block."""
        run = self._runs[number]
        if run.file is None:
            return
        try:
            if self._is_too_full() and not ending:
                raise JournalError(f"{run.file.path}: not written on: the disk is all but full")
            if not run.file.path.exists():
                raise JournalError(f"{run.file.path}: it was deleted")
            run.file.write(block, ending)
            run.written += block.used
        except JournalError as error:
            self._give_up(number, error)

    def finish(self, row: RunRow, stages: list[StageRow], block: SampleBlock) -> RunRow:
        """Write the last block of a run, close its file, and return its row with the number of samples on the disk."""
        run = self._runs[row.run]
        row = replace(row, samples=run.written + (block.used if run.file is not None else 0))
        self.write(row.run, block, ending_text(row, stages))
        row = replace(row, samples=run.written)
        _close(run)
        del self._runs[row.run]
        if run.is_whole:
            self.trouble = ""
        return row

    def lose(self, number: int) -> None:
        """Register that scans of a run are dropped because the disk is too slow."""
        self.trouble = f"run {number}: the disk takes samples too slowly; some are lost"
        if number in self._runs:
            self._runs[number].is_whole = False

    def close(self) -> None:
        """Close the files of all open runs."""
        for run in self._runs.values():
            _close(run)

    def _give_up(self, number: int, error: Exception) -> None:
        """Stop recording samples of a run."""
        run = self._runs[number]
        _close(run)
        run.file, run.is_whole = None, False
        self.trouble = f"run {number}: no further samples: {error}"
        logger.error("%s", self.trouble)

    def _is_too_full(self) -> bool:
        try:
            # Below a tenth of `least_free` no samples are written.
            return shutil.disk_usage(self._folder).free < 0.1 * self._least_free
        except OSError:
            return False


def _close(run: _OpenRun) -> None:
    if run.file is not None:
        with suppress(JournalError):
            run.file.close()
