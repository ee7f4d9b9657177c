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
from tests.skins import WIRED, BoardRig, ScriptedWorld

DISCOVER = SENT[1]
PERIOD_73 = CanFrame(0x5FF, bytes.fromhex("38020049E6"))


def opened(*frames):
    """Return an open link to a board that has answered these frames."""
    rig = BoardRig(WIRED["can"])
    rig.link.open()
    for part in frames:
        rig.link.write(part)
    rig.clock.wait_until(rig.world.time + 0.005)
    while rig.link.read(0.0) is not None:
        pass
    return rig


def test_answer_takes_its_time_on_the_bus():
    rig = opened(SENT[0])
    begun = rig.world.time
    rig.link.write(DISCOVER)
    assert [frame_bits(0), frame_bits(8)] == [55, 135]
    both = (frame_bits(len(DISCOVER.data)) + frame_bits(7)) * 1e-6
    rig.clock.wait_until(begun + both - 1e-6)
    assert rig.link.read(0.0) is None
    rig.clock.wait_until(begun + both + 1e-6)
    assert rig.link.read(0.0) is not None


def test_world_is_measured_at_the_instant_of_the_scan():
    rig = opened(*SENT[:-2], PERIOD_73)
    measured = rig.spied()
    rig.link.write(SENT[-1])
    for time in (0.02, 1.0):  # it is started, and then scans
        rig.clock.wait_until(time)
    assert np.diff([time for time, _ in measured]) == pytest.approx(np.full(12, 0.073))


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
    sequences, took = [], []
    for rig in (plain, late):
        rig.skin.open()
        took.append(rig.clock.now())
        sequences.append([frame.sequence for frame in rig.scan(3.0)])
    assert max(sequences[0]) == pytest.approx(max(sequences[1]), abs=1)
    assert took[1] > took[0] + 2 * 0.2  # request and answer are late


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


@pytest.mark.parametrize("is_fault", [True, False])
def test_the_bus_is_quiet_while_and_after_a_board_is_unplugged(is_fault):
    """A board that is plugged in again waits in its boot loader."""
    rig = opened(*SENT)
    if is_fault:
        rig.unplug(1.0)
    for is_out in (True, False):
        rig.link.is_unplugged = is_out and not is_fault
        rig.clock.wait_until(rig.world.time + 0.9)
        assert rig.link.read(0.0) is None


def lateness(probability: float, delay: float) -> np.ndarray:
    drawn = {**AS_BELIEVED, "scan.late": np.array(probability), "scan.delay": np.array(delay)}
    clock = BusyClock(ScriptedWorld(), drawn, np.random.default_rng(1))
    late = []
    for _ in range(4000):
        due = clock.now() + 0.01
        clock.wait_until(due)
        late.append(clock.now() - due)
    return np.array(late)


@pytest.mark.parametrize(("share", "delay"), [(0.0, 0.01), (0.1, 0.005), (0.5, 0.008)])
def test_scans_are_late_as_configured(share, delay):
    late = lateness(share, delay)
    assert late.min() >= 0.0
    assert (late > 0.0).mean() == pytest.approx(share, abs=0.02)
    assert not share or late[late > 0.0].mean() == pytest.approx(delay, rel=0.1)
