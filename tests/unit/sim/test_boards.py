import numpy as np
import pytest

from drivers.errors import DeviceNotOpenedError
from drivers.skin.cyskin_wire import CanAssembler, HubCommand, Message, SkinWireConfig, decode, encode, to_can
from drivers.transport.wires import CanFrame, LineLostError
from sim.board_links import CanCable, frame_bits
from sim.config import WireFaults
from tests.skins import WIRED, BoardRig

WIRE = SkinWireConfig()


def ask(rig, *messages):
    """Say something to the board on the bus, and return what it has answered 5 ms later."""
    for message in messages:
        for part in to_can(encode(message, WIRE), WIRE.hub):
            rig.link.write(part)
    rig.clock.wait_until(rig.world.time + 0.005)
    return listen(rig)


def listen(rig):
    assembler, heard = CanAssembler(WIRE.hub), []
    while (part := rig.link.read(0.0)) is not None:
        data = assembler.feed(part)
        heard += [] if data is None else [decode(data, WIRE)]
    return heard


@pytest.fixture
def rig():
    made = BoardRig(WIRED["can"])
    made.link.open()
    return made


def test_board_tells_of_its_modules(rig):
    (declared,) = ask(rig, Message(HubCommand.DECLARE))
    assert list(declared.payload) == [4, 12, 12, 12, 12]
    assert len(ask(rig, Message(HubCommand.DETAILS))) == 4


@pytest.mark.parametrize(
    "message",
    [
        Message(0x7F),
        Message(HubCommand.PERIOD, b"\0\0"),
        Message(HubCommand.PERIOD, b"\1"),
        Message(HubCommand.SENSOR_DATA),
    ],
)
def test_board_answers_what_it_does_not_know_with_an_error(rig, message):
    assert [answer.command for answer in ask(rig, message)] == [HubCommand.ERROR]


def test_board_is_quiet_until_it_is_started_and_after_it_is_stopped(rig):
    rig.clock.wait_until(1.0)
    assert listen(rig) == []
    ask(rig, Message(HubCommand.AUTO_SYNC, b"\1"))
    rig.clock.wait_until(2.0)
    assert len(listen(rig)) == 2 * 19
    ask(rig, Message(HubCommand.AUTO_SYNC, b"\0"))
    rig.clock.wait_until(3.0)
    assert listen(rig) == []


def test_frame_of_eight_bytes_is_135_bits_long_at_most():
    assert [frame_bits(0), frame_bits(8)] == [55, 135]


def test_answer_takes_its_time_on_the_bus(rig):
    (request,) = to_can(encode(Message(HubCommand.DECLARE), WIRE), WIRE.hub)
    rig.link.write(request)
    both = (frame_bits(len(request.data)) + frame_bits(8)) * 1e-6
    rig.clock.wait_until(both - 1e-6)
    assert rig.link.read(0.0) is None
    rig.clock.wait_until(both + 1e-6)
    assert rig.link.read(0.0) is not None


def test_world_is_measured_at_the_instant_of_the_scan():
    rig, seen = BoardRig(WIRED["can"]), []
    real = rig.hub.measure
    rig.hub.measure = lambda: (seen.append(rig.world.time), real())[1]
    rig.link.open()
    ask(rig, Message(HubCommand.PERIOD, (73).to_bytes(2, "little")), Message(HubCommand.AUTO_SYNC, b"\1"))
    rig.clock.wait_until(1.0)
    assert np.diff(seen) == pytest.approx(np.full(len(seen) - 1, 0.073))
    assert len(seen) == 13


def test_same_seed_breaks_the_same_way():
    def run():
        rig = BoardRig(WIRED["can"], seed=3)
        rig.skin.open()
        rig.link.faults = WireFaults(drop=0.03, corrupt=0.03)
        return [frame if frame is None else frame.values.tolist() for frame in rig.scan(5.0)]

    assert run() == run()


@pytest.mark.parametrize("name", ["can", "serial"])
def test_delay_makes_frames_later_and_not_fewer(name):
    plain, late = (BoardRig(WIRED[name], faults={"delay": delay}) for delay in (0.0, 0.2))
    sequences = []
    for rig in (plain, late):
        rig.skin.open()
        sequences.append([frame.sequence for frame in rig.scan(3.0)])
    assert max(sequences[0]) == pytest.approx(max(sequences[1]), abs=1)
    assert late.link._to_host[0][0] > late.world.time


def test_serial_port_of_an_unplugged_board_is_gone():
    rig = BoardRig(WIRED["serial"])
    rig.link.open()
    rig.unplug(1.0)
    with pytest.raises(LineLostError):
        rig.link.read(0.0)
    with pytest.raises(DeviceNotOpenedError, match="no such port"):
        rig.link.open()
    rig.clock.wait_until(1.0)
    rig.link.open()
    assert rig.link.read(0.0) == b""


def test_bus_of_an_unplugged_board_is_quiet(rig):
    rig.skin.open()
    rig.unplug(1.0)
    rig.clock.wait_until(rig.world.time + 1.5)
    assert listen(rig) == []


def test_bus_of_a_board_is_quiet_as_long_as_its_cable_is_pulled(rig):
    rig.skin.open()
    rig.link.is_unplugged = True
    rig.clock.wait_until(rig.world.time + 0.5)
    assert listen(rig) == []
    rig.link.is_unplugged = False
    assert [answer.command for answer in ask(rig, Message(HubCommand.DECLARE))] == [HubCommand.DECLARE]


def test_cable_passes_frames_between_a_board_and_another_bus(rig):
    sent, taken = to_can(encode(Message(HubCommand.DECLARE), WIRE), WIRE.hub), []

    class Bus:
        def read(self, timeout: float) -> CanFrame | None:
            return sent.pop() if sent else None

        def write(self, frame: CanFrame) -> None:
            taken.append(frame)

    cable = CanCable(rig.link, Bus())
    for _ in range(2):
        cable.advance()
        rig.clock.wait_until(rig.world.time + 0.01)
    assert [frame.id for frame in taken] == [0x501]


def test_faults_of_the_config_are_bounded():
    with pytest.raises(ValueError, match="less than or equal to 1"):
        WireFaults(drop=1.5)
