"""The switch board's real firmware on an emulated chip: its timing, its faults and the driver's response."""

import random
import shutil
import subprocess
from itertools import groupby, pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest

import drivers
from cell.config.load import load
from cell.lab.trials import run_trial
from drivers.quantities import SwitchState
from drivers.switch.board import SerialSuccessSwitch
from drivers.switch.board_config import SerialSwitchConfig
from drivers.switch.wire import BAUD_RATE, Contacts, Decoder, SwitchReport
from drivers.transport.serial_line import SerialLine
from drivers.transport.traffic import PlaybackLine, RecordedWire, Recorder, TrafficEndedError
from sim.boards.board_clock import BoardClock
from sim.boards.switch_board import FREQUENCY, Chip, EmulatedSwitchBoard
from tests.emulation import emulated_or_skip
from tests.fakes import FakeClock

SOURCES = Path(drivers.__file__).parent / "switch" / "firmware"
OPEN, CLOSED = (True, False), (False, True)
"""Levels at the pins of the normally open and the normally closed contact: the one that conducts is low."""
NEITHER, BOTH = (True, True), (False, False)
TIMER_INTERRUPTS = 0x6E
"""TIMSK0, which switches the firmware's tick off."""
SERIAL = ["sim.pace=max", "switch.kind=serial", "switch.port=emulated"]


@pytest.fixture(scope="module", autouse=True)
def _tools():
    emulated_or_skip()


class Bench:
    """A chip with its pins in the test's hands."""

    def __init__(self) -> None:
        self.chip, self.cycle, self.decoder = Chip(), 0, Decoder()

    def run(self, time: float, pins: tuple[bool, bool]) -> list[tuple[float, SwitchReport]]:
        """Run for so long, s, and return the reports, each with the time at which its last bit ends."""
        self.cycle += round(time * FREQUENCY)
        return [
            (cycle / FREQUENCY, report)
            for cycle, byte in self.chip.run(self.cycle, *pins)
            for report in self.decoder.feed(bytes([byte]))
        ]

    @property
    def now(self) -> float:
        return self.cycle / FREQUENCY


@pytest.fixture
def bench():
    made = Bench()
    yield made
    made.chip.stop()


@pytest.mark.skipif(
    shutil.which("avr-gcc") is None, reason="avr-gcc is not installed: apt-get install gcc-avr avr-libc"
)
def test_make_gives_the_committed_firmware_bit_for_bit(tmp_path):
    for name in ("switch.c", "Makefile"):
        shutil.copy(SOURCES / name, tmp_path)
    subprocess.run(["make", "-s", "-C", tmp_path], check=True, capture_output=True)
    assert (tmp_path / "switch.hex").read_bytes() == (SOURCES / "switch.hex").read_bytes()


def test_reports_come_forty_times_a_second(bench):
    reports = bench.run(1.0, OPEN)[2:]
    assert all(later - now == pytest.approx(0.025, abs=1e-4) for (now, _), (later, _) in pairwise(reports))
    assert {(r.contacts, r.normally_open, r.normally_closed) for _, r in reports} == {(Contacts.OPEN, False, True)}
    assert all((later.time - now.time) == 25 for (_, now), (_, later) in pairwise(reports))


def test_an_edge_is_reported_within_eleven_milliseconds(bench):
    chance, latencies = random.Random(7), []
    bench.run(0.1, OPEN)
    for _ in range(200):
        bench.run(chance.uniform(0.05, 0.1), OPEN)
        edge = bench.now
        stamp = next(stamp for stamp, report in bench.run(0.05, CLOSED) if report.contacts is Contacts.CLOSED)
        latencies.append(stamp - edge)
    # Four to five ticks of debounce, a heartbeat that may be under way, and ten characters of its own.
    assert 0.0065 < sorted(latencies)[100] < 0.009
    assert max(latencies) < 0.011


def test_a_bouncing_contact_gives_one_edge(bench):
    bench.run(0.1, OPEN)
    chance = random.Random(3)
    reports = []
    for _ in range(40):
        reports += bench.run(chance.uniform(0.0001, 0.0015), chance.choice([CLOSED, NEITHER]))
    reports += bench.run(0.1, CLOSED)
    states = [report.contacts for _, report in reports]
    assert [now != later for now, later in pairwise(states)].count(True) == 1
    assert states[-1] is Contacts.CLOSED


@pytest.mark.parametrize(
    ("first", "pins", "time", "then", "seen", "last"),
    [
        (OPEN, CLOSED, 0.0038, OPEN, {Contacts.OPEN}, Contacts.OPEN),
        (OPEN, NEITHER, 0.045, OPEN, {Contacts.OPEN}, Contacts.OPEN),
        (CLOSED, NEITHER, 0.1, NEITHER, {Contacts.CLOSED, Contacts.DISAGREE}, Contacts.DISAGREE),
        (CLOSED, BOTH, 0.1, BOTH, {Contacts.CLOSED, Contacts.DISAGREE}, Contacts.DISAGREE),
    ],
    ids=["knock", "lever under way", "neither conducts", "both conduct"],
)
def test_a_knock_is_no_edge_and_a_contradiction_is_reported(bench, first, pins, time, then, seen, last):
    bench.run(0.1, first)
    states = [report.contacts for _, report in bench.run(time, pins) + bench.run(0.1, then)]
    assert set(states) <= seen
    assert states[-1] is last


def test_after_a_reset_the_first_report_is_debounced_anew(bench):
    bench.run(0.1, CLOSED)
    bench.chip.reset()
    states = [report.contacts for _, report in bench.run(0.1, OPEN)]
    assert set(states) == {Contacts.OPEN}


def test_hung_firmware_starts_again_past_the_boot_loader_and_reports_it(bench):
    bench.run(0.1, OPEN)
    before = bench.chip.resets
    for _ in range(2):
        bench.chip.spoil_data(TIMER_INTERRUPTS, 0)
        reports = bench.run(0.5, CLOSED)
        assert all(report.was_hung for _, report in reports[1:])
        assert reports[-1][1].contacts is Contacts.CLOSED
    assert bench.chip.resets == before
    bench.chip.reset()  # by the pin: no hang
    assert not bench.run(0.2, OPEN)[-1][1].was_hung


def test_a_broken_program_is_found_by_the_self_test_and_never_closed(bench):
    bench.run(0.1, OPEN)
    bench.chip.spoil_program(2000)
    bench.chip.reset()
    reports = bench.run(0.2, CLOSED)
    assert {(report.contacts, report.is_program_broken) for _, report in reports} == {(Contacts.UNKNOWN, True)}


@pytest.mark.parametrize(
    ("faults", "reason"),
    [
        (("corrupt=0.01", "resets=[12.0, 14.0, 16.0]", "unplugged=[[9.0, 11.0]]"), ""),
        (("delay=0.5",), ""),
        (("unplugged=[[9.0, 1e6]]",), "switch_unknown"),
    ],
    ids=["bad wiring", "late", "pulled out"],
)
def test_bad_wiring_of_the_switch_ends_in_true_success_or_its_fault(faults, reason):
    row = run_trial(load(sets=[*SERIAL, *(f"boards.switch.faults.{fault}" for fault in faults)]).cell, 2)
    assert (row.outcome, row.reason) == ("failure" if reason else "success", reason)
    assert row.switch_closed or reason


def test_recorded_traffic_of_the_switch_is_played_back_bit_for_bit(tmp_path):
    path, clock = tmp_path / "traffic", FakeClock()
    lever = SimpleNamespace(now=clock.now, is_switch_pressed=lambda: clock.now() % 2.0 > 1.0)
    board = EmulatedSwitchBoard(lever)
    board.open()
    both = BoardClock(clock, (board,))
    config = SerialSwitchConfig(kind="serial", port=board.port)
    recorder = Recorder(path, "serial", both)
    live = states(
        SerialSuccessSwitch(config, recorder, RecordedWire(SerialLine(board.port, BAUD_RATE), recorder)), both
    )
    for _ in range(2):
        board.close()
    play = PlaybackLine(path)
    assert states(SerialSuccessSwitch(config, play, play), play) == live
    assert [state for state, _ in groupby(live)] == [SwitchState.OPEN, SwitchState.CLOSED] * 2 + [SwitchState.OPEN]


def states(switch, clock):
    """Read a switch in every scan for 4.5 s, or until its recording ends."""
    read = []
    switch.open()
    while clock.now() < 4.5:
        try:
            clock.wait_until(clock.now() + 0.01)
        except TrafficEndedError:
            break
        read.append(switch.read())
    switch.close()
    return read
