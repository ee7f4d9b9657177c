"""Playback of a recorded run, or the present one, in a window."""

import time
from threading import Event

from cell.film.recorded import recorded
from cell.records.journal import Journal
from cell.records.schema import RUNNING
from sim.visual.viewer import Window


class RunPlayback:
    """A run played in real time; for the present run, new samples are read as they are recorded."""

    def __init__(self, journal: Journal, number: int) -> None:
        """Read the record.

        Raises:
            JournalError: The run cannot be read, see `recorded`.
        """
        self._journal, self._number = journal, number
        self.run = recorded(journal, number)
        self._asked = 0.0

    def scan_at(self, elapsed: float) -> int:
        """Return the number of the scan to show at `elapsed`, s, after the start; after the end of the run, its last scan."""
        is_growing = self.run.row.outcome == RUNNING
        # Period of reading new samples of the present run, s; the journal writes them once a second.
        if is_growing and elapsed > float(self.run.times[-1]) and elapsed - self._asked > 0.5:
            self._asked = elapsed
            self.run = recorded(self._journal, self._number)
        return self.run.at(elapsed)


def play(journal: Journal, number: int, stop: Event) -> None:
    """Play a run in real time until its window is closed or `stop` is set.

    Raises:
        JournalError: The run cannot be read, see `recorded`.
        ConfigError: There is no display.
    """
    playback = RunPlayback(journal, number)
    with Window(playback.run.facts, playback.run.hole()) as window:
        began = time.monotonic()
        while window.is_open() and not stop.is_set():
            scan = playback.scan_at(time.monotonic() - began)
            window.show(playback.run.moment(scan), playback.run.trail(scan))
            # Period of the pictures, s.
            stop.wait(1.0 / 30.0)
