"""Commissioning: a PLC goes through every step on a real socket, or makes a forbidden request, and the record shows it."""

import threading

import pytest

from cell.calibrate.commissioning import MOTION, CellSighting, Walk, WatchedLine, record
from cell.commands.check import _sheet
from cell.run.states import State
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Command, Control, Report, Result
from plc_bridge.protocol.registers import VERSION, VERSION_MAJOR, VERSION_MINOR, Lease
from plc_bridge.protocol.watchdog import PlcSight
from tests.quick_cell import quick_cell
from tests.trouble import until

HOST = "127.0.0.1"
CODES = {"stop": Control.STOP, "reset": Control.RESET, "motion": MOTION, "loss": MOTION, "return": Control.RESET}
CONFIG = PlcConfig(life_timeout=3.0, lease_timeout=20.0, modbus=ModbusConfig(port=0))


def reach(peer, state):
    """Cycle until the cell is in a state, however slow its clock is."""
    while peer.cycle().state != state:
        pass


def act(peer, step):
    """Do what a step of the commissioning asks of a PLC, which cycles afterwards, but not after a loss."""
    if step in ("connection", "return"):
        peer.connect()
    if step == "return":
        peer.trigger(Control.CLEAR)
        reach(peer, State.STOPPED)
    if step in CODES:
        peer.trigger(CODES[step])
    elif step == "lease":
        assert peer.take()
    elif step == "result":
        peer.acknowledge()
    if step == "loss":
        reach(peer, State.EXECUTE)
        peer.trigger(Control.HOLD)
        reach(peer, State.HELD)
        peer.close()


class Commissioned:
    """A cell under commissioning, and a PLC that does what the technician is asked for."""

    def __init__(self, served, walk):
        self.served, self.walk = served, walk

    def passed(self, peer, count):
        """Cycle until so many steps have passed."""
        until(lambda: (peer.cycle(), len(self.walk.findings) >= count)[1])
        assert all(finding.passed for finding in self.walk.findings), self.walk.findings

    def go(self):
        peer = Peer(*self.served.bridge.address)
        for count, step in enumerate(self.walk.steps(), 1):
            if step.name == "loss":
                self.served.program.may_end.clear()
            act(peer, step.name)
            if step.name in ("loss", "return"):
                until(lambda count=count: len(self.walk.findings) == count)
            else:
                self.passed(peer, count)
        peer.close()


@pytest.fixture
def commissioned(loaded, tmp_path):
    stop = threading.Event()
    walk = Walk(HOST, CONFIG.life_timeout, 60.0, lambda text: None)

    def watched(bridge):
        line = WatchedLine(bridge, walk, stop)
        line.begin()
        return line

    with quick_cell(loaded, CONFIG, tmp_path, MOTION, watched) as served:
        yield Commissioned(served, walk)


def test_a_plc_that_does_all_that_is_asked_is_signed_off(commissioned):
    commissioned.go()
    found = record(commissioned.walk, "A. Technician", "2026-11-22T09:00:00+00:00", "0.1.0")
    assert found["passed"]
    assert [each["step"] for each in found["steps"]] == [step.name for step in commissioned.walk.steps()]
    assert found["map"] == f"{VERSION_MAJOR}.{VERSION_MINOR}"
    sheet = _sheet(found)
    assert "PASSED\nsigned: " in sheet
    assert "ABORTED" in next(line for line in sheet.splitlines() if " loss: " in line)


def walk(host=HOST):
    return Walk(host, 1.0, 60.0, lambda text: None)


def moment(time=0.0, holder="", state=State.IDLE, command=None, plc=None, **report):
    return CellSighting(time, plc, holder, Report(state=state, **report), command)


def sight(changes=1, gap=0.02, version=VERSION):
    return PlcSight(f"{HOST}:5", version, changes, gap, 0.0, True)


def run_to(name, way):
    """Let a walk stand before a step."""
    from cell.calibrate.commissioning import Finding

    for step in way.steps():
        if step.name == name:
            return way
        way.findings.append(Finding(step.name, True, ""))
    raise AssertionError(name)


@pytest.mark.parametrize(
    ("step", "moments", "said"),
    [
        ("connection", [moment(plc=sight(version=0x0100))], "has map 1.0"),
        ("life counter", [moment(plc=sight(1)), moment(5.0, plc=sight(51, 0.6))], "half of plc.life_timeout allowed"),
        ("lease", [moment(holder="terminal")], "terminal holds it"),
        ("motion", [moment(command=Command(2, 100))], "code 100 was started"),
        (
            "motion",
            [moment(command=Command(2, MOTION)), moment(sequence=2, result=Result.FAILURE, run=4)],
            "run 4 ended in FAILURE",
        ),
        ("stop", [moment(), moment(61.0)], "not seen within 60 s"),
    ],
)
def test_what_a_plc_shall_not_do_fails_its_step_and_ends_the_walk(step, moments, said):
    way = run_to(step, walk())
    for each in moments:
        way.look(each)
    assert not way.findings[-1].passed
    assert said in way.findings[-1].measured
    assert way.is_over


def test_a_lease_of_another_identity_at_the_same_address_counts():
    way = run_to("lease", walk())
    way.look(moment(holder=f"Operator@{HOST}:4000"))
    assert way.findings[-1].passed


def test_wish_for_the_lease_is_the_number_that_the_step_names():
    assert f"command_lease {Lease.TAKE}" in next(step.asks for step in walk().steps() if step.name == "lease")
