"""The node obeys CiA 301: NMT, SDO, PDO, heartbeat and emergency."""

import random

import pytest

from drivers.transport.wires import CanFrame
from plc_bridge.canopen.node import ANYBODY, NmtState
from plc_bridge.protocol.messages import UNNUMBERED, Command, Control, LeaseState, Refusal, Report, Result
from tests.canopen_rig import (
    NODE,
    PLACES,
    PLC,
    PRE_OPERATIONAL,
    PROGRAM,
    RESET_COMMUNICATION,
    RESET_NODE,
    START,
    STOP,
    Rig,
)
from tests.scan_thread import take

HEARTBEAT, EMCY = 0x700 + NODE, 0x080 + NODE
TPDO1, TPDO2, TPDO3, TPDO4 = (base + NODE for base in (0x180, 0x280, 0x380, 0x480))
LEASE, STOP_OBJECT = 0x300 + NODE, 0x400 + NODE


@pytest.fixture
def rig():
    return Rig()


def numbers(data):
    return [int.from_bytes(data[place : place + 2], "little") for place in range(0, len(data), 2)]


@pytest.fixture
def operational():
    """Return a rig whose node is operational and has sent its first reports."""
    rig = Rig()
    rig.nmt(START)
    rig.wait(0.01)
    rig.take()
    return rig


def beats(rig, seconds):
    """Return how many heartbeats come in this time, s."""
    rig.wait(0.01)
    rig.take()
    rig.wait(seconds)
    return len(rig.take(HEARTBEAT))


# NMT and heartbeat.


@pytest.mark.parametrize(("milliseconds", "number"), [(None, 10), (0, 0), (50, 20), (500, 2)])
def test_the_heartbeat_follows_object_1017(rig, milliseconds, number):
    if milliseconds is not None:
        assert rig.write(0x1017, 0, milliseconds, 2) == 0
    assert beats(rig, 1.0) == number


def test_a_late_look_brings_one_heartbeat_and_no_burst(rig):
    rig.wait(0.01)
    rig.take()
    rig.now += 1.0
    for _ in range(2):
        rig.node.tick(rig.now)
    assert len(rig.take(HEARTBEAT)) == 1


@pytest.mark.parametrize(
    ("command", "state"),
    [(START, NmtState.OPERATIONAL), (STOP, NmtState.STOPPED), (PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL)],
)
@pytest.mark.parametrize("node", [0, NODE])
def test_nmt_commands_for_this_node_or_for_all_are_obeyed(rig, command, state, node):
    rig.nmt(command, node)
    rig.wait(0.01)
    assert rig.take(HEARTBEAT)[-1] == bytes([state])


@pytest.mark.parametrize(
    ("frame", "is_extended"),
    [
        ([START, NODE + 1], False),
        ([START], False),
        ([START, NODE, 0], False),
        ([77, NODE], False),
        ([START, NODE], True),
    ],
)
def test_other_nmt_frames_change_nothing(rig, frame, is_extended):
    rig.node.receive(CanFrame(0, bytes(frame), is_extended=is_extended), rig.now)
    assert rig.node.state is NmtState.PRE_OPERATIONAL


@pytest.mark.parametrize("command", [RESET_NODE, RESET_COMMUNICATION])
def test_a_reset_goes_back_to_the_defaults_and_boots_up(rig, command):
    assert rig.take(HEARTBEAT) == [b"\x00"]
    rig.nmt(START)
    rig.write(0x1017, 0, 500, 2)
    rig.write(0x2000, 4, 9, 2)
    rig.take()
    rig.nmt(command)
    assert rig.take(HEARTBEAT) == [b"\x00"]
    assert rig.node.state is NmtState.PRE_OPERATIONAL
    assert (rig.read(0x1017), rig.read(0x2000, 4)) == (100, 0)
    rig.wait(0.1)
    assert rig.take(HEARTBEAT)[0] == bytes([127])


# SDO by NMT state.


@pytest.mark.parametrize(("command", "is_served"), [(PRE_OPERATIONAL, True), (START, True), (STOP, False)])
def test_sdo_is_served_in_every_state_but_stopped(rig, command, is_served):
    rig.nmt(command)
    assert (rig.ask(bytes.fromhex("4000100000000000")) is not None) is is_served


def test_a_transfer_does_not_survive_a_stop(rig):
    rig.ask(bytes.fromhex("4008100000000000"))
    rig.nmt(STOP)
    rig.nmt(PRE_OPERATIONAL)
    assert rig.ask(bytes.fromhex("6000000000000000"))[0] == 0x80


@pytest.mark.parametrize("length", [0, 1, 7])
def test_sdo_frames_of_another_length_are_counted_and_left(rig, length):
    assert rig.ask(bytes(length)) is None
    assert rig.node.counts.malformed == 1


# Commands.


@pytest.mark.parametrize("command", [PRE_OPERATIONAL, STOP])
def test_outside_operational_no_pdo_commands(rig, command):
    rig.nmt(START)
    rig.command(1, 1)
    rig.nmt(command)
    rig.command(2, 2, PROGRAM)
    rig.nmt(START)
    assert rig.bridge.poll() is None


@pytest.mark.parametrize(("raw", "abort"), [(10, 0), (9, 0x06090032), (5000, 0), (5001, 0x06090031), (-1, 0x06090032)])
def test_a_parameter_beyond_its_limits_is_refused_before_it_is_stored(rig, raw, abort):
    place = PLACES["command_parameter_1"].subindex
    rig.write(0x2000, place, 77, 4)
    assert rig.write(0x2000, place, raw, 4) == abort
    assert rig.read(0x2000, place) == (77 if abort else raw)


def test_a_command_can_be_sent_by_sdo_alone(rig):
    rig.nmt(START)
    rig.write(0x2000, 2, 1, 2)
    rig.write(0x2000, 3, PROGRAM, 2)
    rig.write(0x2000, 2, 2, 2)
    assert rig.bridge.poll() == Command(2, PROGRAM, source=f"node {PLC}")


def test_plain_ladder_runs_by_coils(rig):
    execute = PLACES["execute"]
    rig.write(execute.index, execute.subindex, 0, 1)
    rig.write(0x2000, 3, PROGRAM, 2)
    rig.write(execute.index, execute.subindex, 1, 1)
    assert take(rig.bridge).code == PROGRAM
    assert rig.read(PLACES["busy"].index, PLACES["busy"].subindex) == 1


@pytest.mark.parametrize("wish", [4, 0xFFFF])
def test_a_wish_for_the_lease_that_there_is_not_is_refused(operational, wish):
    operational.give(LEASE, b"\0\0" + wish.to_bytes(2, "little"))
    assert operational.take(EMCY)[0][:2] == bytes.fromhex("0082")
    assert (operational.read(0x2000, 6), operational.bridge.holder) == (0, "")


def test_a_short_pdo_is_left_and_reported_once(operational):
    for _ in range(2):
        operational.give(0x200 + NODE, bytes(7))
    assert [numbers(data[:2]) for data in operational.take(EMCY)] == [[0x8210]]
    assert operational.node.counts.malformed == 2


def test_each_kind_of_refusal_is_logged_once(rig, caplog):
    for _ in range(3):
        rig.write(0x2000, PLACES["command_parameter_1"].subindex, 5001, 4)
        rig.give(0, [START])
    assert [record.getMessage() for record in caplog.records] == [
        "node 1: SDO 2000subA refused: Code 0x06090031, Value of parameter written too high",
        "CANopen node 16: frame 0x000 left: 1 bytes",
    ]
    assert (rig.node.counts.exceptions, rig.node.counts.malformed) == (3, 3)


# Stopping.


@pytest.mark.parametrize("command", [START, PRE_OPERATIONAL, STOP])
def test_anybody_may_stop_in_any_state(rig, command):
    rig.nmt(command)
    rig.give(STOP_OBJECT, b"\x00")
    assert rig.bridge.poll() is None
    rig.give(STOP_OBJECT, b"\x01")
    assert rig.bridge.poll() == Command(UNNUMBERED, Control.STOP, source=ANYBODY)


def test_the_stop_of_another_node_is_no_sign_of_life(rig):
    rig.start()
    rig.now += 0.9
    rig.give(STOP_OBJECT, b"\x00")
    rig.now += 0.2
    assert rig.bridge.poll().code == Control.LOST


# The PLC's heartbeat.


@pytest.mark.parametrize(("behaviour", "state"), [(0, 127), (1, 5), (2, 4)])
def test_a_lost_heartbeat_ends_the_run_and_leads_where_object_1029_states(rig, behaviour, state):
    rig.write(0x1029, 1, behaviour, 1)
    rig.beat()
    assert rig.start() is not None
    for cycle in range(60):  # the life counter goes on
        rig.command(3 + cycle, 2, PROGRAM, 3)
        rig.wait(0.01)
    assert rig.bridge.poll() == Command(2, Control.LOST, source=f"node {PLC}")
    assert [numbers(data[:2]) for data in rig.take(EMCY)] == [[0x8130]]
    assert (rig.bridge.diagnostics.lost, rig.node.state) == (1, state)


@pytest.mark.parametrize("has_beaten", [True, False])
def test_a_heartbeat_in_time_or_that_never_was_is_not_lost(rig, has_beaten):
    rig.start()
    for _ in range(10):
        if has_beaten:
            rig.beat()
        rig.wait(0.5)
    assert rig.node.state is NmtState.OPERATIONAL


@pytest.mark.parametrize(
    ("milliseconds", "silence", "state"),
    [(500, 0.5, NmtState.OPERATIONAL), (500, 0.51, NmtState.PRE_OPERATIONAL), (0, 60.0, NmtState.OPERATIONAL)],
)
def test_the_heartbeat_of_the_plc_is_lost_after_its_time(rig, milliseconds, silence, state):
    rig.write(0x1016, 1, PLC << 16 | milliseconds, 4)
    rig.nmt(START)
    rig.beat()
    rig.now += silence
    rig.node.tick(rig.now)
    assert rig.node.state is state


def test_a_heartbeat_that_returns_clears_the_error(rig):
    rig.beat()
    rig.wait(0.6)
    assert rig.read(0x1001) == 0x11
    rig.take()
    rig.beat()
    assert rig.take(EMCY) == [bytes(8)]
    assert rig.read(0x1001) == 0


def test_a_plc_that_boots_up_begins_anew(rig):
    rig.start()
    rig.bridge.publish(Report(sequence=2, result=Result.SUCCESS))
    rig.beat(state=0)
    rig.command(1, 3, PROGRAM)
    assert rig.bridge.poll() is None
    assert numbers(rig.take(TPDO1)[-1])[3] == Refusal.ADOPTED


def test_leaving_operational_stops_the_run(rig):
    rig.start()
    rig.nmt(PRE_OPERATIONAL)
    assert rig.bridge.poll().code == Control.LOST


def test_a_plc_without_life_counter_lives_by_its_heartbeat(rig):
    rig.nmt(START)
    rig.command(0, 1)
    rig.command(0, 2, PROGRAM)
    take(rig.bridge)
    for _ in range(20):
        rig.beat()
        rig.wait(0.4)
        assert rig.bridge.poll() is None


def test_object_1016_names_the_plc(rig):
    assert rig.write(0x1016, 1, 9 << 16 | 200, 4) == 0
    rig.nmt(START)
    rig.command(1, 1)
    rig.command(2, 2, PROGRAM)
    assert take(rig.bridge).source == "node 9"
    rig.give(0x700 + 9, [5])
    rig.wait(0.21)
    assert rig.bridge.poll().code == Control.LOST


# Reports.


def test_a_report_goes_out_by_itself_and_the_answer_last(rig):
    rig.start()
    rig.take()
    rig.bridge.publish(
        Report(sequence=2, state=17, result=Result.SUCCESS, run=70000, stage=5, reason=2, progress=100, total_time=1.5)
    )
    rig.wait(0.2)
    sent = {frame.id: frame.data for frame in rig.sent}
    assert numbers(sent[TPDO1]) == [2, 2, Result.SUCCESS, 0]
    assert numbers(sent[TPDO2]) == [17, 0, 5, 2]
    assert numbers(sent[TPDO3])[1:] == [100, 1500, 0]
    assert numbers(sent[TPDO4]) == [70000 & 0xFFFF, 70000 >> 16, LeaseState.YOURS, Result.SUCCESS]
    first = [frame.id for frame in rig.sent if frame.id in (TPDO1, TPDO2, TPDO4)]
    assert first[-1] == TPDO1


def test_nothing_goes_out_by_itself_outside_operational(rig):
    rig.bridge.publish(Report(state=17))
    rig.wait(1.0)
    assert {frame.id for frame in rig.sent} == {HEARTBEAT}


@pytest.mark.parametrize(("timer", "number"), [(None, 4), (125, 16)])
def test_a_report_that_does_not_change_comes_with_its_event_timer(rig, timer, number):
    if timer is not None:
        rig.write(0x1800, 5, timer, 2)
    rig.nmt(START)
    rig.wait(0.01)
    rig.take()
    rig.wait(2.0)
    assert len(rig.take(TPDO1)) == number


def test_the_life_counter_keeps_its_inhibit_time(rig):
    rig.nmt(START)
    for _ in range(100):
        rig.bridge.publish(Report())
        rig.wait(0.01)
    assert len(rig.take(TPDO3)) in (10, 11)


@pytest.mark.parametrize(("fault", "said"), [(1001, "01ff 91 e903 7011 01"), (2002, "02ff 81 d207 7011 01")])
def test_a_fault_is_sent_as_emergency_once_the_node_may_send(rig, fault, said):
    """A fault of the skin or its wire, 1xxx, is one of communication too."""
    rig.nmt(STOP)
    rig.take()
    rig.bridge.publish(Report(fault=fault, run=70000))
    rig.wait(0.05)
    assert rig.take(EMCY) == []
    rig.nmt(PRE_OPERATIONAL)
    rig.wait(0.05)
    message = bytes.fromhex(said)
    assert rig.take(EMCY) == [message]
    assert rig.read(0x1001) == message[2]
    rig.bridge.publish(Report())
    rig.wait(0.05)
    assert [data[:3] for data in rig.take(EMCY)] == [bytes(3)]


def test_after_a_lost_bus_everything_is_sent_again(operational):
    operational.node.recover()
    operational.wait(0.01)
    sent = [frame.id for frame in operational.sent]
    assert sent[0] == EMCY
    assert set(sent) >= {TPDO1, TPDO2, TPDO3, TPDO4}


# Hostile frames.


def test_20000_random_frames_do_no_harm():
    """Frames to every COB-ID of the node, of every length, half of them well-formed in their first bytes."""
    draw = random.Random(20261121)
    rig = Rig()
    first = {
        0: [bytes([command, NODE]) for command in (START, START, START, STOP, PRE_OPERATIONAL, RESET_NODE)],
        0x600 + NODE: [bytes([c]) for c in (0x40, 0x60, 0x70, 0x00, 0x0D, 0x10, 0x80)]
        + [bytes([c]) + r.index.to_bytes(2, "little") + bytes([r.subindex])
           for c in (0x21, 0x23, 0x2B, 0x2F, 0x40) for r in PLACES.values() if r.index],
        0x200 + NODE: [b""],
        LEASE: [b""],
        STOP_OBJECT: [b"", b"\x01"],
        0x700 + PLC: [b"\x05", b"\x00"],
    }  # fmt: skip
    limited = [r for r in PLACES.values() if r.index and r.high is not None]
    for _ in range(20_000):
        cob = draw.choice(tuple(first))
        data = draw.choice(first[cob]) if draw.random() < 0.5 else b""
        length = 8 if len(data) == 4 else draw.choice((len(data), 1, 2, 4, 7, 8, 8, 8))
        rig.give(cob, (data + draw.randbytes(8))[:length])
        rig.now += 0.0005
        command = take(rig.bridge)
        if command is not None and command.code == PROGRAM:
            assert all(0.001 <= value <= 0.5 for _, value in command.parameters)
    rig.nmt(START)
    rig.wait(0.01)
    for register in limited:
        value = rig.read(register.index, register.subindex)
        assert value == 0 or register.low <= value <= register.high, register.name
    rig.nmt(RESET_NODE)
    assert rig.start() is not None
