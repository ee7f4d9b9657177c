"""A PLC that starts runs over a measured connection."""

import random
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from cell.lab.line.cell_process import PATIENCE
from cell.lab.line.client import Client
from cell.run.states import State
from drivers.errors import CellError
from plc_bridge.images import CommandImage
from plc_bridge.messages import Control, Report, Result
from plc_bridge.registers import VERSION
from skills.catalogue import CATALOGUE

CYCLE = 0.02
"""Time between two signs of life during a run, s."""
RESETS = 5
"""Number of resets tried if a fault returns."""
_WAITING, _INTERRUPTED = (State.IDLE, State.COMPLETE), (State.STOPPED, State.ABORTED)
_INSERT, _GRASP = CATALOGUE["insert_peg"].code, CATALOGUE["grasp_from_rack"].code


@dataclass(frozen=True, slots=True)
class Start:
    """One command, in times of this computer, s."""

    sent: float
    written: float
    seen: float
    is_at_once: bool
    """True if the first answer contained Busy."""


class Plc:
    """A PLC that starts runs over a measured connection."""

    def __init__(self, client: Client) -> None:
        self._client, self._rng = client, random.Random(1)
        self._image = CommandImage(sequence=client.report().sequence, version=VERSION)
        self.cycle()

    def cycle(self, **changes: int) -> Report:
        """Increment the life counter and write the block; return the report."""
        life = self._image.life % 0xFFFF + 1
        self._image = replace(self._image, life=life, life_tail=life, **changes)  # type: ignore[arg-type]
        self._client.write(self._image)
        return self._client.report()

    def trigger(self, code: int) -> Report:
        """Send a command."""
        return self.cycle(sequence=(self._image.sequence + 1) % 0x10000, code=code)

    def until(self, is_met: Callable[[Report], bool]) -> Report:
        """Cycle until the report meets a condition, and return the report."""
        deadline = time.monotonic() + PATIENCE
        while not is_met(report := self.cycle()):
            if time.monotonic() > deadline:
                raise CellError(f"the cell does not get on: {report}")
        return report

    def finish(self) -> None:
        """Stop a run, acknowledge its end, and make the cell ready."""
        self._client.stop()
        self.until(lambda report: report.state in _INTERRUPTED)
        self.make_ready()

    def make_ready(self) -> None:
        """Bring the cell to IDLE from any state; a run in progress may end first."""
        report = self.until(lambda report: report.state in (*_WAITING, *_INTERRUPTED))
        for _ in range(RESETS):
            if report.state in _WAITING:
                break
            self.trigger(Control.RESET)
            report = self.until(lambda r: r.answered == self._image.sequence and r.state in (*_WAITING, *_INTERRUPTED))
        else:
            raise CellError(f"the cell does not become ready: {report}")
        # A stopped run can leave its peg in the hand.
        self.trigger(Control.CLEARED)
        self.until(lambda report: report.answered == self._image.sequence)
        self.cycle(acknowledge=self._image.sequence)

    def ensure_running(self, code: int) -> None:
        """Start a run if none is in progress, and wait until it is; a stopped run is started again."""
        if self.cycle().state == State.EXECUTE:
            return
        self.make_ready()
        self.trigger(code)
        self.until(lambda report: report.state == State.EXECUTE)

    def time_start(self, period: float) -> Start:
        """Start a run, time it, and stop it."""
        time.sleep(self._rng.uniform(0.0, period))
        life = self._image.life % 0xFFFF + 1
        self._image = replace(
            self._image, life=life, life_tail=life, sequence=(self._image.sequence + 1) % 0x10000, code=_GRASP
        )
        sent = time.perf_counter()
        self._client.write(self._image)
        written = time.perf_counter()
        is_at_once = self._client.is_busy()
        while (report := self._client.report()).state == State.IDLE:
            if time.perf_counter() - sent > PATIENCE:
                raise CellError(f"the cell does not start: {report}")
        seen = time.perf_counter()
        self.finish()
        return Start(sent, written, seen, is_at_once)

    def keep_running(self, is_over: threading.Event) -> None:
        """Start insertions one after the other until the condition holds."""
        while not is_over.is_set():
            report = self.trigger(_INSERT)
            while not is_over.wait(CYCLE) and (report.sequence != self._image.sequence or not report.result):
                report = self.cycle()
            self.cycle(acknowledge=self._image.sequence)
            if report.result == Result.FAULT:
                raise CellError(f"fault {report.fault} while measuring")
        self.finish()
