"""The switch board's real firmware on an emulated chip: its timing, its faults, and what the driver makes of them."""

import math
import random
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest

import drivers
from cell.assembly import assemble, opened
from cell.config import load
from cell.trials import run_trial
from drivers.errors import SwitchUnknownError
from drivers.switch_wire import Contacts, Decoder, SwitchReport
from sim.switch_board import FREQUENCY, Chip
from skills.catalogue import CATALOGUE
from skills.contract import Outcome
from tests.emulation import emulated_or_skip

SOURCES = Path(drivers.__file__).parent / "switch_firmware"
MILLISECOND = FREQUENCY // 1000
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


def test_a_knock_shorter_than_the_debounce_is_no_edge(bench):
    bench.run(0.1, OPEN)
    reports = bench.run(0.0038, CLOSED) + bench.run(0.1, OPEN)
    assert {report.contacts for _, report in reports} == {Contacts.OPEN}


@pytest.mark.parametrize("pins", [NEITHER, BOTH])
def test_contacts_that_contradict_each_other_disagree(bench, pins):
    bench.run(0.1, CLOSED)
    reports = bench.run(0.1, pins)
    assert reports[-1][1].contacts is Contacts.DISAGREE
    assert Contacts.OPEN not in {report.contacts for _, report in reports}


def test_the_lever_under_way_keeps_the_old_state(bench):
    bench.run(0.1, OPEN)
    assert {report.contacts for _, report in bench.run(0.045, NEITHER)} == {Contacts.OPEN}


def test_after_a_reset_the_first_report_is_debounced_anew(bench):
    bench.run(0.1, CLOSED)
    bench.chip.reset()
    states = [report.contacts for _, report in bench.run(0.1, OPEN)]
    assert set(states) == {Contacts.OPEN}


def test_hung_firmware_is_restarted_by_its_watchdog(bench):
    bench.run(0.1, OPEN)
    bench.chip.spoil_data(TIMER_INTERRUPTS, 0)
    reports = bench.run(0.5, CLOSED)
    assert all(report.was_hung for _, report in reports[1:])
    assert reports[-1][1].contacts is Contacts.CLOSED


def test_a_broken_program_is_found_by_the_self_test_and_never_closed(bench):
    bench.run(0.1, OPEN)
    bench.chip.spoil_program(2000)
    bench.chip.reset()
    reports = bench.run(0.2, CLOSED)
    assert {(report.contacts, report.is_program_broken) for _, report in reports} == {(Contacts.UNKNOWN, True)}


def test_a_whole_insertion_runs_through_the_firmware():
    row = run_trial(load(sets=SERIAL).cell, 2)
    assert (row.outcome, row.reason, row.switch_closed) == ("success", "", True)


def insertion(action, stage="spiral_adjust", delay=0.0):
    """Run a whole insertion; `action(board)` happens so long, s, after a stage begins.

    Returns:
        The last outcome and whether the peg truly presses the switch then.
    """
    config = load(sets=[*SERIAL, "sim.seed=2"]).cell
    cell = assemble(config)
    (board,) = cell.boards
    due = []
    with opened(cell):
        ctx = cell.context(2)
        pressed = []

        def watch(seen, setpoint):
            if ctx.stage == "spiral_adjust":
                pressed.append(board.is_pressed)
            if ctx.stage == stage and not due:
                due.append(seen.stamp + delay)
            if due and seen.stamp >= due[0]:
                due[0] = math.inf
                action(board)

        ctx.record = watch
        records = CATALOGUE["insert_peg"].run(config.skill_set(), ctx)
        assert due == [math.inf]
    seated = next(record.result.outcome for record in records if record.name == "spiral_adjust")
    return seated, pressed[-1]


def test_a_board_unplugged_while_the_peg_is_seated_is_a_fault():
    with pytest.raises(SwitchUnknownError):
        insertion(lambda board: board.close())


def test_a_board_unplugged_and_plugged_in_again_during_the_search_serves_the_insertion():
    def replug(board):
        board.close()
        board.open()

    assert insertion(replug, "spray_search") == (Outcome.SUCCESS, True)


def test_a_reset_in_the_middle_does_not_harm():
    assert insertion(lambda board: board.chip.reset(), delay=0.3) == (Outcome.SUCCESS, True)


def test_a_cable_that_spoils_every_hundredth_byte_does_not_harm():
    chance = random.Random(5)

    def spoil(data):
        return bytes(byte ^ (1 << chance.randrange(8) if chance.random() < 0.01 else 0) for byte in data)

    def wear(board):
        board.spoil = spoil

    assert insertion(wear, "grasp_from_rack") == (Outcome.SUCCESS, True)
