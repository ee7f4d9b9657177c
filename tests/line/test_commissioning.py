"""Commissioning: a PLC goes through every step on a real socket, or makes a forbidden request, and the record shows it."""

import threading
from functools import partial
from itertools import takewhile

import pytest

from cell.calibrate.commissioning import MOTION, CellSighting, Finding, Walk, WatchedLine, record
from cell.commands.check import _sheet
from cell.run.states import State
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Command, Control, Report, Result
from plc_bridge.protocol.registers import VERSION, VERSION_MAJOR, VERSION_MINOR, Lease
from plc_bridge.protocol.watchdog import PlcSight
from tests.quick_cell import quick_cell
from tests.trouble import first, until

HOST = "127.0.0.1"
CODES = {"stop": Control.STOP, "reset": Control.RESET, "motion": MOTION, "loss": MOTION, "return": Control.RESET}
CONFIG = PlcConfig(life_timeout=3.0, lease_timeout=20.0, modbus=ModbusConfig(port=0))


def walk(life_timeout=1.0):
    return Walk(HOST, life_timeout, 60.0, lambda text: None)


def reach(peer, state):
    """Cycle until the cell is in a state, however slow its clock is."""
    first(peer.cycle, lambda report: report.state == state)


def act(peer, step):
    """Do what a step of the commissioning requires of a PLC."""
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


def watched(walk, bridge):
    """Return a bridge's line on which a walk looks."""
    line = WatchedLine(bridge, walk, threading.Event())
    line.begin()
    return line


def test_a_plc_that_does_all_that_is_asked_is_signed_off(loaded, tmp_path):
    done = walk(CONFIG.life_timeout)
    with quick_cell(loaded, CONFIG, tmp_path, MOTION, partial(watched, done)) as served:
        peer = Peer(*served.bridge.address)
        for count, step in enumerate(done.steps(), 1):
            if step.name == "loss":
                served.program.may_end.clear()
            act(peer, step.name)
            is_away = step.name in ("loss", "return")
            until(lambda count=count, is_away=is_away: (is_away or peer.cycle()) and len(done.findings) >= count)
            assert all(finding.passed for finding in done.findings), done.findings
        peer.close()
    found = record(done, "A. Technician", "2026-11-22T09:00:00+00:00", "0.1.0")
    assert found["passed"]
    assert [each["step"] for each in found["steps"]] == [step.name for step in done.steps()]
    assert found["map"] == f"{VERSION_MAJOR}.{VERSION_MINOR}"
    sheet = _sheet(found)
    assert "PASSED\nsigned: " in sheet
    assert "ABORTED" in next(line for line in sheet.splitlines() if " loss: " in line)


def moment(time=0.0, holder="", state=State.IDLE, command=None, plc=None, **report):
    return CellSighting(time, plc, holder, Report(state=state, **report), command)


def sight(changes=1, gap=0.02, version=VERSION):
    return PlcSight(f"{HOST}:5", version, changes, gap, 0.0, True)


def walk_before(name):
    """Return a walk that has passed all steps before one."""
    begun = walk()
    before = takewhile(lambda step: step.name != name, begun.steps())
    begun.findings += [Finding(step.name, True, "") for step in before]
    return begun


@pytest.mark.parametrize(
    ("step", "moments", "said"),
    [
        ("connection", [moment(plc=sight(version=0x0100))], f"has map 1.0; {VERSION_MAJOR}.x allowed"),
        ("life counter", [moment(plc=sight(1)), moment(5.0, plc=sight(51, 0.6))], "half of plc.life_timeout allowed"),
        ("lease", [moment(holder="terminal")], "terminal holds the lease"),
        ("motion", [moment(command=Command(2, 100))], "code 100 was started"),
        (
            "motion",
            [moment(command=Command(2, MOTION)), moment(sequence=2, result=Result.FAILURE, run=4)],
            "run 4 ended in FAILURE",
        ),
        ("stop", [moment(), moment(61.0)], "not seen within 60 s"),
    ],
)
def test_a_forbidden_request_fails_its_step_and_ends_the_walk(step, moments, said):
    way = walk_before(step)
    for each in moments:
        way.look(each)
    assert not way.findings[-1].passed
    assert said in way.findings[-1].measured
    assert way.is_over


def test_a_lease_of_another_identity_at_the_same_address_counts():
    way = walk_before("lease")
    (asked,) = (step.asks for step in way.steps() if step.name == "lease")
    assert f"command_lease {Lease.TAKE}" in asked
    way.look(moment(holder=f"Operator@{HOST}:4000"))
    assert way.findings[-1].passed
