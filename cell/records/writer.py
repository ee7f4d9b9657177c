"""Writes the journal on a separate thread, so that neither the disk nor a lock delays the scan.

Two bounded queues hold the waiting records. Rows of the index are retried until they are written. If the disk refuses
a block of samples, the rest of that run's samples is dropped.
"""

import fcntl
import logging
import os
import re
import shutil
import struct
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Condition, Thread

from cell.config.cell_config import JournalConfig
from cell.records.index import OWNERS_FOLDER, DamagedIndexError, Index, require_own
from cell.records.kept_file import OWNER_ONLY
from cell.records.run_samples import RunSamples
from cell.records.sample_blocks import SampleBlock
from cell.records.schema import ConfigRow, EventRow, RunRow, StageRow
from cell.records.upkeep import (
    close_lost_runs,
    delete_old,
    made_again,
    next_number,
    opened_to_write,
    warn_of_clock,
)
from cell.records.wall_clock import now_text
from drivers.errors import JournalError
from drivers.scene_facts import SceneFacts

logger = logging.getLogger(__name__)

MOST_ROWS = 20_000
"""Largest number of waiting rows: a day of events of a cell in production."""
MOST_BLOCKS = 60
"""Largest number of waiting blocks of samples: a minute at the usual scan rate, 4 MB."""
RETRY_AFTER = 1.0
"""Delay between two attempts to write a row, s."""
CLOSING_TIME = 5.0
"""Longest time to write waiting records at the end, s."""
DISK_PERIOD = 10.0
"""Period of the check of the disk's free space, s."""
UPKEEP_PERIOD = 3600.0
"""Time between two deletions of old records, s."""
LOCK = "writer.lock"
"""Name of the file with process id and start time of the writing process, which locks the folder."""
_HOLDER = re.compile(r"(\d+) ([\d:.T+-]+)\n", re.ASCII)


class JournalWriter:
    """The writing side of a journal; every method except `open`, `close` and `flush` returns at once."""

    def __init__(self, folder: Path, keep: JournalConfig) -> None:
        """Keep the folder, and the limits of its records."""
        self._folder, self._keep = folder, keep
        self._rows: deque[Callable[[Index], object]] = deque()
        self._blocks: deque[Callable[[], None]] = deque()
        """Waiting actions on samples."""
        self._changed = Condition()
        self._thread: Thread | None = None
        self._opening: Future[None] = Future()
        """Done when the index is open, or cannot be opened."""
        self._is_closing, self._is_busy = False, False
        self._index: Index | None = None
        self._samples = RunSamples(folder, keep.least_free)
        self._last, self._ready = 0, 0
        """Last assigned run number, and the number whose file is reserved; 0 for none."""
        self._row_trouble = self._file_trouble = ""
        self.is_disk_low = False
        """True if the free space of the disk is below `JournalConfig.least_free`."""
        self._lock = -1
        self._given_up = 0.0
        """Monotonic time after which waiting records are lost, s; 0 before the end."""

    @property
    def trouble(self) -> str:
        """Records that cannot be written now, and the reason; empty without trouble."""
        return self._row_trouble or self._file_trouble or self._samples.trouble

    def open(self) -> None:
        """Open the index, close runs that a killed program left open, and start to write.

        Raises:
            JournalError: The folder or the index cannot be used, or another process writes it.
        """
        self._thread = Thread(target=self._work, name="journal", daemon=True)
        self._thread.start()
        try:
            self._opening.result()
        except Exception:  # the thread has ended; the error is raised again
            self._thread.join()
            self._thread = None
            raise

    def close(self) -> None:
        """Write the waiting records, for a few seconds at most, and end; idempotent."""
        if self._thread is None:
            return
        with self._changed:
            self._is_closing = True
            self._changed.notify_all()
        self._thread.join(2.0 * CLOSING_TIME)
        self._thread = None

    def flush(self, timeout: float = 10.0) -> bool:
        """Wait until all records are written; return True if they are. The scan must not call this."""
        with self._changed:
            self._changed.notify_all()
            return self._changed.wait_for(self._is_idle, timeout)

    def begin(self, row: RunRow, facts: SceneFacts | None = None) -> RunRow:
        """Return the row of a run with its number, and queue it for writing; `facts` serve pictures of the run."""
        with self._changed:
            row = replace(row, run=self._ready or self._last + 1)
            self._last, self._ready = row.run, 0
        self._add_row(lambda index: index.put(row, how="INSERT OR IGNORE"))
        self._add_block(lambda: self._samples.begin(row, facts))
        return row

    def write(self, run: int, block: SampleBlock) -> None:
        """Write a block of the samples of a run."""
        self._add_block(lambda: self._samples.write(run, block), droppable_of=run)

    def finish(self, row: RunRow, stages: Sequence[StageRow] = (), rest: SampleBlock | None = None) -> None:
        """Write the end of a run and its stages, with its last samples."""
        self._add_block(lambda: self._finish(row, list(stages), rest or SampleBlock()))

    def note(self, row: EventRow) -> None:
        """Write an event; the index numbers it."""
        self._add_row(lambda index: index.put(row))

    def keep_config(self, row: ConfigRow) -> None:
        """Record a whole config, unless it is on record already."""
        self._add_row(lambda index: index.put(row, how="INSERT OR IGNORE"))

    def _add_row(self, job: Callable[[Index], object]) -> None:
        with self._changed:
            if len(self._rows) >= MOST_ROWS:
                self._row_trouble = f"more than {MOST_ROWS} rows wait for the index; newer ones are lost"
                return
            self._rows.append(job)
            self._changed.notify_all()

    def _add_block(self, job: Callable[[], None], droppable_of: int | None = None) -> None:
        """Queue an action on samples; if too many wait, drop an action that only writes samples of the run `droppable_of`."""
        with self._changed:
            if droppable_of is not None and len(self._blocks) >= MOST_BLOCKS:
                self._samples.lose(droppable_of)
                return
            self._blocks.append(job)
            self._changed.notify_all()

    def _work(self) -> None:
        try:
            self._start()
        except Exception as error:  # passed to `open`, which raises it instead of waiting for ever
            self._end()
            is_known = not isinstance(error, OSError)
            self._opening.set_exception(error if is_known else JournalError(f"{self._folder}: cannot be used: {error}"))
            return
        try:
            self._write_until_closed()
        except Exception as error:  # without this report the records would stop silently
            logger.exception("error in the journal's writer")
            self._row_trouble = f"the journal's writer ended: {type(error).__name__}: {error}"
        finally:
            self._end()

    def _start(self) -> None:
        require_own(self._folder)
        self._folder.mkdir(mode=OWNERS_FOLDER, parents=True, exist_ok=True)
        self._take_lock()
        try:
            self._tidy()
        # Errors raised if the index holds values that this program cannot have written.
        except (ArithmeticError, LookupError, TypeError, ValueError, struct.error) as error:
            logger.debug("content of the index", exc_info=True)
            self._put_aside(f"its content cannot be used: {type(error).__name__}: {error}")
            self._tidy()
        self._claim()
        self._look_at_disk()
        self._opening.set_result(None)

    def _take_lock(self) -> None:
        """Lock the journal against writing by other processes.

        Raises:
            JournalError: Another process holds the lock.
        """
        # The lock is on the folder, because a person can delete a file as an old lock while its program runs.
        self._lock, holder = os.open(self._folder, os.O_RDONLY), self._folder / LOCK
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            first = _HOLDER.match(holder.read_text(errors="replace") if holder.exists() else "")
            who = (
                f"process {first[1]} writes these records since {first[2]}"
                if first
                else "another process writes these records"
            )
            raise JournalError(f"{self._folder}: {who}; stop it, or name another folder; reading goes on") from None
        with os.fdopen(os.open(holder, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, OWNER_ONLY), "w") as file:
            file.write(f"{os.getpid()} {now_text()}\n")

    def _tidy(self) -> None:
        """Close lost runs and delete old records."""
        index = self._index_in_place()
        close_lost_runs(index, self._folder)
        self._last = max(self._last, next_number(index, self._folder) - 1)
        warn_of_clock(index, self._folder, self._keep)
        self._delete_old()

    def _write_until_closed(self) -> None:
        began, retry = time.monotonic(), 0.0
        disk, upkeep = began + DISK_PERIOD, began + UPKEEP_PERIOD
        while True:
            now = time.monotonic()
            if now >= disk:
                self._look_at_disk()
                disk = now + DISK_PERIOD
            if now >= upkeep:
                self._delete_old()
                upkeep = now + UPKEEP_PERIOD
            self._claim()
            if now >= retry and not self._write_rows():
                retry = time.monotonic() + (RETRY_AFTER if not self._is_closing else RETRY_AFTER / 10.0)
            self._write_blocks()
            with self._changed:
                self._is_busy = False
                self._changed.notify_all()
                if self._is_closing and self._has_written_or_given_up(now):
                    return
                self._rest(is_retry_due=now >= retry)
                self._is_busy = True

    def _rest(self, is_retry_due: bool) -> None:
        """Wait for records, or for the next attempt to write rows."""
        if not self._blocks and not (self._rows and is_retry_due):
            self._changed.wait(0.05 if self._is_closing else RETRY_AFTER if self._rows else DISK_PERIOD)

    def _has_written_or_given_up(self, now: float) -> bool:
        """Return True at the end if all records are written, or `CLOSING_TIME` is over."""
        if not self._rows and not self._blocks:
            return True
        self._given_up = self._given_up or now + CLOSING_TIME
        if now <= self._given_up:
            return False
        logger.error("%d rows of the journal are lost: %s", len(self._rows), self.trouble)
        return True

    def _is_idle(self) -> bool:
        is_dead = self._thread is None or not self._thread.is_alive()
        return is_dead or (not self._rows and not self._blocks and not self._is_busy)

    def _write_rows(self) -> bool:
        """Write all waiting rows as one transaction; return True if it succeeded."""
        jobs = list(self._rows)
        if not jobs:
            return True
        try:
            index = self._index_in_place()
            with index.at_once():
                for job in jobs:
                    job(index)
        except DamagedIndexError as error:
            self._put_aside(str(error))
            return False
        except JournalError as error:
            self._complain(str(error))
            return False
        with self._changed:
            for _ in jobs:
                self._rows.popleft()
        self._row_trouble = ""
        return True

    def _index_in_place(self) -> Index:
        """Return the index; if it was deleted or replaced, rebuild it from the samples.

        Raises:
            JournalError: The index cannot be used.
        """
        if self._index is not None and not self._index.is_in_place():
            self._index.close()
            self._index = None
        if self._index is None:
            self._index = opened_to_write(self._folder)
            close_lost_runs(self._index, self._folder, self._samples.under_way)
        return self._index

    def _put_aside(self, why: str) -> None:
        """Set a damaged index aside and rebuild it from the samples."""
        if self._index is not None:
            self._index.close()
            self._index = None
        try:
            self._index = made_again(self._folder, why)
            close_lost_runs(self._index, self._folder, self._samples.under_way)
        except JournalError as error:
            self._complain(str(error))

    def _complain(self, why: str) -> None:
        if not self._row_trouble:
            logger.error("not on record, tried again: %s", why)
        self._row_trouble = why

    def _write_blocks(self) -> None:
        while True:
            with self._changed:
                if not self._blocks:
                    return
                job = self._blocks.popleft()
            job()

    def _finish(self, row: RunRow, stages: list[StageRow], block: SampleBlock) -> None:
        row = self._samples.finish(row, stages, block)
        with self._changed:
            self._rows.append(lambda index: index.put_ended(row, stages))

    def _claim(self) -> None:
        """Reserve the next run number."""
        if self._ready or self._is_closing:
            return
        try:
            number = self._samples.claim(self._last)
        except OSError as error:
            self._file_trouble = f"{self._folder}: no file can be made: {error.strerror}"
            return
        self._file_trouble = ""
        with self._changed:
            if number > self._last:
                self._ready = number

    def _look_at_disk(self) -> None:
        with suppress(OSError):
            self.is_disk_low = shutil.disk_usage(self._folder).free < self._keep.least_free

    def _delete_old(self) -> None:
        try:
            delete_old(self._index_in_place(), self._folder, self._keep)
        except (JournalError, OSError) as error:
            logger.error("old records are not deleted: %s", error)

    def _end(self) -> None:
        """Release the unused number, and close."""
        if self._ready:
            self._samples.give_back(self._ready)
        self._samples.close()
        if self._index is not None:
            self._index.close()
        if self._lock >= 0:
            os.close(self._lock)
        with self._changed:
            self._is_busy = False
            self._changed.notify_all()
