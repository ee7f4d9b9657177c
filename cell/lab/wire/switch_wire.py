"""Measures of the success switch's wire: time from the pin's edge to the scan that reads it, and recovery of a lost board."""

from dataclasses import dataclass

import numpy as np

from drivers.protocols import Clock
from drivers.quantities import SwitchState
from drivers.switch.board import REOPEN_PERIOD, SerialSuccessSwitch
from drivers.switch.board_config import SerialSwitchConfig
from drivers.switch.wire import Contacts, Decoder
from sim.board_clock import BoardClock
from sim.switch_board import FREQUENCY, Chip, EmulatedSwitchBoard

SCAN_PERIOD = 0.01
"""Period of the scan, s."""
REST = 0.1
"""Time between edges, s; a random time of up to the same length is added."""
AWAY = 1.0
"""Shortest time of a board without its plug, s; up to a period of the driver's attempts is added."""


@dataclass(frozen=True, slots=True)
class SwitchLine:
    """Result of the real firmware on an emulated chip with the real driver."""

    edges: int
    report_p50: float
    """Median time from the edge at the pin to the last bit of the report, in the chip's own time, s."""
    report_max: float
    scan_p50: float
    """Median time from the edge at the pin to the scan that reads it, s, at 100 Hz."""
    scan_p99: float
    losses: int
    recovery_p50: float
    """Median time from plugging in to the first scan with a state, s; a boot loader, which the chip lacks, adds 1 to 2
    s."""
    recovery_max: float


def measure(edges: int, losses: int) -> SwitchLine:
    """Return the figures of this number of edges and unplugged boards, at random instants.

    Raises:
        DeviceNotOpenedError: The chip cannot be emulated here.
    """
    rng = np.random.default_rng(0)
    reports = _to_report(edges, rng)
    scans = _to_scan(edges, rng)
    recoveries = _recoveries(losses, rng)
    return SwitchLine(
        edges,
        float(np.percentile(reports, 50)),
        max(reports),
        float(np.percentile(scans, 50)),
        float(np.percentile(scans, 99)),
        losses,
        float(np.percentile(recoveries, 50)),
        max(recoveries),
    )


def _to_report(edges: int, rng: np.random.Generator) -> list[float]:
    """Return the time from each edge to the end of the first report of it, s."""
    chip, decoder, cycle, pressed, taken = Chip(), Decoder(), 0, False, []
    for _ in range(edges):
        cycle += round((REST + float(rng.uniform(0.0, REST))) * FREQUENCY)
        decoder.feed(bytes(byte for _, byte in chip.run(cycle, not pressed, pressed)))
        pressed, edge = not pressed, cycle
        wanted = Contacts.CLOSED if pressed else Contacts.OPEN
        cycle += round(REST * FREQUENCY)
        for stamp, byte in chip.run(cycle, not pressed, pressed):
            if any(report.contacts is wanted for report in decoder.feed(bytes([byte]))):
                taken.append((stamp - edge) / FREQUENCY)
                break
        decoder = Decoder()
    chip.stop()
    return taken


class _Lever:
    """A clock with fine steps, and a lever pressed at set times."""

    def __init__(self) -> None:
        self.time, self.edge, self.pressed = 0.0, np.inf, False

    def now(self) -> float:
        return self.time

    def wait_until(self, stamp: float) -> None:
        self.time = max(self.time, stamp)

    def is_switch_pressed(self) -> bool:
        return self.pressed != (self.time >= self.edge)


class _FineClock:
    """Lets the board read the lever every 0.1 ms instead of once per scan."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def now(self) -> float:
        return self._clock.now()

    def wait_until(self, stamp: float) -> None:
        while (now := self._clock.now()) < stamp:
            self._clock.wait_until(min(now + 1e-4, stamp))


def _bench() -> tuple[_Lever, EmulatedSwitchBoard, _FineClock, SerialSuccessSwitch]:
    lever = _Lever()
    board = EmulatedSwitchBoard(lever)
    board.open()
    clock = _FineClock(BoardClock(lever, (board,)))
    switch = SerialSuccessSwitch(SerialSwitchConfig(kind="serial", port=board.port), clock)
    switch.open()
    return lever, board, clock, switch


def _to_scan(edges: int, rng: np.random.Generator) -> list[float]:
    """Return the time from each edge to the scan that reads it, s."""
    lever, board, clock, switch = _bench()
    taken = []
    for _ in range(edges):
        before = switch.read()
        lever.edge = clock.now() + REST + float(rng.uniform(0.0, REST))
        while switch.read() is before:
            clock.wait_until(clock.now() + SCAN_PERIOD)
        taken.append(clock.now() - lever.edge)
        lever.pressed, lever.edge = not lever.pressed, np.inf
    switch.close()
    board.close()
    return taken


def _recoveries(losses: int, rng: np.random.Generator) -> list[float]:
    """Return the time from plugging in to the first scan with a state, s."""
    _, board, clock, switch = _bench()
    taken = []
    for _ in range(losses):
        clock.wait_until(clock.now() + float(rng.uniform(0.0, 0.2)))
        board.close()
        end = clock.now() + AWAY + float(rng.uniform(0.0, REOPEN_PERIOD))
        while clock.now() < end:
            clock.wait_until(clock.now() + SCAN_PERIOD)
            assert switch.read() is SwitchState.UNKNOWN
        plugged = clock.now()
        board.open()
        while switch.read() is SwitchState.UNKNOWN:
            clock.wait_until(clock.now() + SCAN_PERIOD)
        taken.append(clock.now() - plugged)
    switch.close()
    board.close()
    return taken
