"""The supervision of a bus that dies, with time that only moves when somebody waits."""

import itertools

import pytest

from drivers.errors import DeviceNotOpenedError
from drivers.transport.wires import CanFrame, CanLostError
from plc_bridge.bridge import Bridge
from plc_bridge.canopen.bus import FIRST_PAUSE, FIRST_QUIET, LONGEST_PAUSE, LONGEST_QUIET, BusHealth, CanopenServer
from plc_bridge.config import PlcConfig
from plc_bridge.protocol.messages import Control
from tests.canopen_rig import CONFIG, NODE, PLC, PROGRAM, REGISTERS

HEARTBEAT = 0x700 + NODE


class FakeBus:
    """A bus that can be cut; reading takes the time that it waits."""

    def __init__(self):
        self.name = "fake"
        self.bad_frames = 0
        self.now = 100.0
        self.is_cut = self.is_open = self.is_missing = False
        self.opened = []
        self.incoming = []
        self.sent = []

    def open(self):
        self.opened.append(self.now)
        if self.is_missing:
            raise DeviceNotOpenedError("CAN bus fake: no such device")
        self.is_open = True

    def close(self):
        self.is_open = False

    def read(self, timeout):
        self._check()
        if self.incoming:
            return self.incoming.pop(0)
        self.now += timeout
        return None

    def write(self, frame):
        self._check()
        self.sent.append((self.now, frame))

    def wait(self, seconds):
        self.now += seconds

    def _check(self):
        if self.is_cut or not self.is_open:
            raise CanLostError("CAN bus fake: gone")


class Rig:
    def __init__(self):
        self.bus = FakeBus()
        self.bridge = Bridge(PlcConfig(), {PROGRAM: "insert_peg"}, now=lambda: self.bus.now)
        self.server = CanopenServer(CONFIG, REGISTERS, self.bus, self.bridge, lambda: self.bus.now, self.bus.wait)
        self.server.open()

    def run(self, seconds, beats=False):
        end = self.bus.now + seconds
        beat = self.bus.now
        while self.bus.now < end:
            if beats and self.bus.now >= beat and not self.bus.is_cut:
                self.bus.incoming.append(CanFrame(0x700 + PLC, b"\x05"))
                beat = self.bus.now + 0.1
            self.server.step()

    def command(self, *values):
        self.bus.incoming.append(CanFrame(0x200 + NODE, b"".join(v.to_bytes(2, "little") for v in values)))
        self.run(0.02)


@pytest.fixture
def rig():
    rig = Rig()
    yield rig
    rig.server.close()


def test_a_node_that_was_kept_from_reading_finds_the_heartbeat_that_waited(rig):
    rig.run(1.0, beats=True)
    rig.bus.now += 3.0
    rig.bus.incoming += [CanFrame(0x200 + PLC), CanFrame(0x700 + PLC, b"\x05")]
    rig.run(0.1)
    assert rig.server.counts.dropped == 0
    rig.run(CONFIG.plc_timeout + 0.1)
    assert rig.server.counts.dropped == 1


def test_a_flood_of_frames_does_not_hide_a_silent_plc(rig):
    rig.run(1.0, beats=True)
    for _ in range(2000):
        rig.bus.now += 0.001
        rig.bus.incoming.append(CanFrame(0x200 + PLC))
        rig.server.step()
    assert rig.server.counts.dropped == 1


def test_a_lost_bus_is_opened_again_and_the_node_goes_on(rig):
    rig.run(1.0, beats=True)
    rig.bus.is_cut = True
    rig.run(0.1)
    assert not rig.bus.is_open
    rig.bus.is_cut = False
    rig.run(1.0, beats=True)
    late = [frame.id for stamp, frame in rig.bus.sent if stamp > 101.1]
    assert late[0] == 0x080 + NODE  # recovered, says the emergency
    assert late.count(HEARTBEAT) >= 4


def test_pauses_grow_and_the_loss_is_logged_once(rig, caplog):
    rig.bus.is_cut = True
    rig.run(0.02)
    rig.bus.is_missing = True
    rig.run(60.0)
    gaps = [later - earlier for earlier, later in itertools.pairwise(rig.bus.opened[1:])]
    assert gaps[:4] == pytest.approx([1.0, 2.0, 4.0, 8.0], abs=0.05)
    assert max(gaps) == pytest.approx(LONGEST_PAUSE, abs=0.05)
    warnings = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert (warnings, rig.server.counts.dropped) == (["CANopen: CAN bus fake: gone"], 1)


def test_a_run_stops_although_the_bus_is_gone(rig):
    rig.bus.incoming.append(CanFrame(0, bytes([1, NODE])))
    rig.run(0.3, beats=True)
    rig.command(1, 1, 0, 0)
    rig.command(2, 2, PROGRAM, 0)
    assert rig.bridge.poll().code == PROGRAM
    rig.bus.is_cut = True
    rig.run(0.6)
    assert rig.bridge.poll().code == Control.LOST


@pytest.mark.parametrize(("spoken", "opened"), [(0.0, 1), (1.0, 2)])
def test_only_a_bus_that_has_spoken_and_falls_silent_is_opened_anew(rig, spoken, opened):
    rig.run(spoken, beats=True)
    rig.run(FIRST_QUIET + FIRST_PAUSE + 0.5)
    assert len(rig.bus.opened) == opened


def test_a_bus_missing_at_the_start_is_refused_at_once():
    bus = FakeBus()
    bus.is_missing = True
    server = CanopenServer(CONFIG, REGISTERS, bus, Bridge(PlcConfig(), {}))
    with pytest.raises(DeviceNotOpenedError, match="no such device"):
        server.start()
    server.close()


def test_frames_make_a_bus_healthy_again():
    health = BusHealth()
    assert [health.lose(), health.lose(), health.lose()] == [(True, 0.5), (False, 1.0), (False, 2.0)]
    assert health.hear(10.0)
    assert not health.hear(10.1)
    assert health.lose() == (True, FIRST_PAUSE)


def test_silence_is_borne_longer_each_time():
    health = BusHealth()
    health.hear(0.0)
    now, waits = 0.0, []
    for _ in range(6):
        start = now
        while not health.has_died(now):
            now += 0.5
        waits.append(now - start)
    assert waits == [5.5, 10.5, 20.5, 40.5, LONGEST_QUIET + 0.5, LONGEST_QUIET + 0.5]
