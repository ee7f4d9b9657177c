"""A switch board that is silent, stale or hung is unknown, never open or closed."""

import logging
from dataclasses import replace

import pytest

from drivers.errors import DeviceNotOpenedError
from drivers.quantities import SwitchState
from drivers.switch.board import FIRMWARE, REOPEN_PERIOD, STALE, SerialSuccessSwitch
from drivers.switch.board_config import SerialSwitchConfig
from drivers.switch.wire import Contacts, SwitchReport, encode
from sim.boards.terminal import Terminal
from tests.fakes import FakeClock

HEARTBEAT = 0.025


class Board:
    """Sends as the firmware does, in the clock's time, from a port of its own."""

    def __init__(self, clock: FakeClock) -> None:
        self.clock, self.terminal = clock, Terminal("test-switch")
        self.report: SwitchReport | None = SwitchReport(FIRMWARE, Contacts.OPEN, 0, normally_closed=True)
        self.noise = b""
        self.due = HEARTBEAT
        self.delay = 0.0
        self.terminal.plug_in()
        clock.every.append(self.send)

    def send(self) -> None:
        while self.due <= self.clock.now():
            time = round((self.due - self.delay) * 1000)
            self.terminal.send(self.noise if self.report is None else encode(replace(self.report, time=time)))
            self.due += HEARTBEAT


@pytest.fixture
def clock():
    return FakeClock()


@pytest.fixture
def board(clock):
    made = Board(clock)
    yield made
    made.terminal.unplug()


@pytest.fixture
def switch(board, clock):
    made = SerialSuccessSwitch(SerialSwitchConfig(kind="serial", port=board.terminal.port), clock)
    yield made
    made.close()


@pytest.fixture
def closed(switch, board):
    """Return the opened switch of a board whose contacts are closed."""
    board.report = replace(board.report, contacts=Contacts.CLOSED)
    switch.open()
    return switch


def passed(clock: FakeClock, switch: SerialSuccessSwitch, time: float) -> list[SwitchState]:
    """Return the states read in every scan of 10 ms for `time`, s."""
    states = []
    for _ in range(round(time / 0.01)):
        clock.wait_until(clock.now() + 0.01)
        states.append(switch.read())
    return states


def refused(switch: SerialSuccessSwitch) -> str:
    """Return the reason why the switch does not open."""
    with pytest.raises(DeviceNotOpenedError) as caught:
        switch.open()
    assert "\n" not in str(caught.value)
    assert switch.read() is SwitchState.UNKNOWN
    return str(caught.value)


def test_closed_open_and_broken_contacts_are_distinguished(switch, board, clock):
    switch.open()
    assert switch.read() is SwitchState.OPEN
    for contacts, state in (
        (Contacts.CLOSED, SwitchState.CLOSED),
        (Contacts.DISAGREE, SwitchState.UNKNOWN),
        (Contacts.OPEN, SwitchState.OPEN),
        (Contacts.UNKNOWN, SwitchState.UNKNOWN),
    ):
        board.report = replace(board.report, contacts=contacts)
        assert passed(clock, switch, 0.05)[-1] is state


def test_no_port_and_a_port_in_use_are_named(switch, board, clock):
    missing, other = (
        SerialSuccessSwitch(SerialSwitchConfig(kind="serial", port=port), clock)
        for port in ("/dev/no-such-port", board.terminal.port)
    )
    assert "/dev/no-such-port: no such port" in refused(missing)
    switch.open()
    assert "in use by another program" in refused(other)


@pytest.mark.parametrize(
    ("noise", "told"), [(b"", "silent"), (bytes([0xFF, 0x80, 0x00, 0x1C]), "baud rate other than 38400")]
)
def test_a_board_without_reports_is_not_opened(switch, board, noise, told):
    board.report, board.noise = None, noise
    assert told in refused(switch)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"firmware": 1}, "firmware 1; 2 allowed"),
        ({"firmware": 3}, "firmware 3; 2 allowed: make -C drivers/switch/firmware flash"),
        ({"is_program_broken": True}, "program broken"),
        ({"is_memory_broken": True}, "memory broken"),
        ({"contacts": Contacts.DISAGREE, "normally_closed": False}, "no contact conducts: a broken wire"),
        ({"contacts": Contacts.DISAGREE, "normally_open": True}, "both contacts conduct: a short"),
        ({"contacts": Contacts.UNKNOWN}, "not yet debounced"),
    ],
)
def test_a_board_that_cannot_be_believed_is_not_opened(switch, board, changes, told):
    board.report = replace(board.report, contacts=Contacts.CLOSED)
    board.report = replace(board.report, **changes)
    assert told in refused(switch)


def test_a_board_that_falls_silent_is_unknown_once_its_report_is_stale(closed, board, clock):
    board.report = None
    states = passed(clock, closed, 0.3)
    last = len(states) - 1 - states[::-1].index(SwitchState.CLOSED)
    assert (last + 1) * 0.01 <= STALE
    assert set(states[last + 1 :]) == {SwitchState.UNKNOWN}
    assert "old > 0.1 s limit" in closed.problem()


def test_reports_that_come_late_are_as_stale_as_none(closed, board, clock):
    assert passed(clock, closed, 0.1)[-1] is SwitchState.CLOSED
    for _ in range(20):
        board.delay += STALE / 10
        states = passed(clock, closed, 0.03)
    assert set(states) == {SwitchState.UNKNOWN}
    board.delay = 0.0
    assert passed(clock, closed, 0.1)[-1] is SwitchState.CLOSED


def test_a_repeated_report_grows_stale(closed, board, clock):
    board.noise, board.report = encode(replace(board.report, time=round(clock.now() * 1000))), None
    assert passed(clock, closed, 2 * STALE)[-1] is SwitchState.UNKNOWN


def test_of_waiting_reports_the_newest_counts(switch, board, clock):
    switch.open()
    clock.wait_until(clock.now() + 2.0)
    board.report = replace(board.report, contacts=Contacts.CLOSED)
    clock.wait_until(clock.now() + HEARTBEAT)
    assert switch.read() is SwitchState.CLOSED


def test_waiting_reports_that_overflowed_are_not_trusted(closed, board, clock):
    clock.wait_until(clock.now() + 20.0)
    assert closed.read() is SwitchState.UNKNOWN
    assert passed(clock, closed, 0.1)[-1] is SwitchState.CLOSED


@pytest.mark.parametrize("drift", [0.995, 1.005])
def test_a_board_whose_clock_drifts_is_believed(switch, board, clock, drift):
    switch.open()
    for _ in range(100):
        board.delay = clock.now() * (1.0 - drift)
        assert set(passed(clock, switch, 1.0)) == {SwitchState.OPEN}


def test_a_board_unplugged_and_plugged_in_again_is_unknown_meanwhile(closed, board, clock, caplog):
    with caplog.at_level(logging.WARNING):
        board.terminal.unplug()
        assert set(passed(clock, closed, 2.0)) == {SwitchState.UNKNOWN}
    assert len(caplog.messages) == 1
    board.report = replace(board.report, contacts=Contacts.OPEN)
    board.terminal.plug_in()
    states = passed(clock, closed, REOPEN_PERIOD + 0.1)
    assert set(states) == {SwitchState.UNKNOWN, SwitchState.OPEN}
    assert states[-1] is SwitchState.OPEN


def test_a_board_that_hung_is_on_record(switch, board, clock, caplog):
    switch.open()
    board.report = replace(board.report, was_hung=True)
    with caplog.at_level(logging.WARNING):
        passed(clock, switch, 0.2)
    assert ["watchdog" in message for message in caplog.messages] == [True]
