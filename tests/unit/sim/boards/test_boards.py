"""Emulated boards on their wires, and the clock of a busy computer."""

import numpy as np
import pytest

from drivers.errors import DeviceNotOpenedError
from drivers.transport.wires import CanFrame, LineLostError
from sim.boards.board_links import frame_bits
from sim.boards.busy_clock import BusyClock
from sim.config import WireFaults
from sim.world.reality import AS_BELIEVED
from tests.cyskin_makers import SENT
from tests.skins import WIRED, BoardRig, Cable, ScriptedWorld

DISCOVER, STOP = SENT[1], CanFrame(0x5FF, bytes.fromhex("370100C9"))
PERIOD_73 = CanFrame(0x5FF, bytes.fromhex("38020049E6"))


def ask(rig, *frames):
    """Send frames to the board on the bus, and return what it has answered 5 ms later."""
    for part in frames:
        rig.link.write(part)
    rig.clock.wait_until(rig.world.time + 0.005)
    return listen(rig)


def listen(rig):
    heard = []
    while (part := rig.link.read(0.0)) is not None:
        heard.append(part)
    return heard


@pytest.fixture
def rig():
    made = BoardRig(WIRED["can"])
    made.link.open()
    return made


def test_board_is_quiet_until_it_is_started_and_after_it_is_stopped(rig):
    rig.clock.wait_until(1.0)
    assert listen(rig) == []
    ask(rig, *SENT)
    begun = rig.clock.now()
    rig.clock.wait_until(begun + 1.0)
    assert len(listen(rig)) == 10 * 13
    ask(rig, STOP)
    rig.clock.wait_until(begun + 2.0)
    assert listen(rig) == []


def test_answer_takes_its_time_on_the_bus(rig):
    ask(rig, SENT[0])
    begun = rig.world.time
    rig.link.write(DISCOVER)
    assert [frame_bits(0), frame_bits(8)] == [55, 135]
    both = (frame_bits(len(DISCOVER.data)) + frame_bits(7)) * 1e-6
    rig.clock.wait_until(begun + both - 1e-6)
    assert rig.link.read(0.0) is None
    rig.clock.wait_until(begun + both + 1e-6)
    assert rig.link.read(0.0) is not None


def test_world_is_measured_at_the_instant_of_the_scan():
    rig, seen = BoardRig(WIRED["can"]), []
    real = rig.hub.measure
    rig.hub.measure = lambda: (seen.append(rig.world.time), real())[1]
    rig.link.open()
    ask(rig, *SENT[:-2], PERIOD_73, SENT[-1])
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
    patient = WIRED[name].model_copy(update={"open_timeout": 6.0})
    plain, late = (BoardRig(patient, faults={"delay": delay}) for delay in (0.0, 0.2))
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


def test_bus_of_a_board_is_quiet_while_it_has_no_power_or_its_cable_is_pulled(rig):
    rig.skin.open()
    rig.link.is_unplugged = True
    rig.clock.wait_until(rig.world.time + 0.5)
    assert listen(rig) == []
    rig.link.is_unplugged = False
    assert ask(rig, *SENT[:2])[0].data[0] == 0x10
    rig.unplug(1.0)
    rig.clock.wait_until(rig.world.time + 1.5)
    assert listen(rig) == []


def test_cable_passes_frames_between_a_board_and_another_bus(rig):
    sent, taken = [DISCOVER, SENT[0]], []

    class Bus:
        def read(self, timeout: float) -> CanFrame | None:
            return sent.pop() if sent else None

        def write(self, frame: CanFrame) -> None:
            taken.append(frame)

    cable = Cable(rig.link, Bus())
    for _ in range(2):
        cable.advance()
        rig.clock.wait_until(rig.world.time + 0.01)
    assert [frame.id for frame in taken] == [0x5FF]


def lateness(probability: float, delay: float, scans: int = 4000) -> np.ndarray:
    drawn = {**AS_BELIEVED, "scan.late": np.array(probability), "scan.delay": np.array(delay)}
    clock = BusyClock(ScriptedWorld(), drawn, np.random.default_rng(1))
    late = []
    for _ in range(scans):
        due = clock.now() + 0.01
        clock.wait_until(due)
        late.append(clock.now() - due)
    return np.array(late)


@pytest.mark.parametrize(("share", "delay"), [(0.0, 0.01), (0.1, 0.005), (0.5, 0.008)])
def test_scans_are_late_as_often_and_as_much_as_was_asked_for(share, delay):
    late = lateness(share, delay)
    assert late.min() >= 0.0
    assert (late > 0.0).mean() == pytest.approx(share, abs=0.02)
    assert not share or late[late > 0.0].mean() == pytest.approx(delay, rel=0.1)
