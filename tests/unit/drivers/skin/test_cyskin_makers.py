"""The driver of a CySkin hub against the bytes of the makers' library; see `tests.cyskin_makers`."""

import numpy as np
import pytest

from drivers.skin.board_config import HubConfig, IcubConfig
from drivers.skin.cyskin_wire import HubCommand, Message, SkinWireConfig, WireError, decode, encode, encode_period
from drivers.skin.layout import positions
from drivers.skin.port import HubOnCan
from tests.cyskin_makers import COUNTS, NUMBERED, PERIODS, PLACES, SENT, WRONG_CHECK_SUM, answers
from tests.skins import ICUB_PLACES

WIRE = SkinWireConfig()


class ScriptedBus:
    """Answers each frame of the dialogue as the makers' library was answered."""

    def __init__(self):
        self._turns, self._waiting, self.sent = answers(), [], []

    open = close = lambda self: None

    def write(self, frame):
        self.sent.append(frame)
        if self._turns and frame == self._turns[0][0]:
            self._waiting += self._turns.pop(0)[1]

    def read(self, timeout):
        return self._waiting.pop(0) if self._waiting else None


@pytest.fixture
def bus():
    return ScriptedBus()


@pytest.fixture
def scan(bus):
    """The first scan that the driver takes from the bus."""
    port, now = HubOnCan(bus, HubConfig(), 0.1), 0.0
    while not (scans := port.exchange(now)):
        now += 0.01
        assert now < 2.0, port.trouble()
    return scans[0]


def test_start_up_is_the_makers_to_the_bit(bus, scan):
    assert bus.sent == SENT


def test_readings_are_those_that_the_makers_library_reports(scan):
    wanted = np.array(list(COUNTS.values()))
    assert scan.counts.reshape(4, 10).tolist() == wanted[:, HubConfig().channels].tolist()
    assert scan.temperature.tolist() == wanted[:, 0].tolist()


@pytest.mark.parametrize(("board", "places"), [(HubConfig(), (None, *PLACES)), (IcubConfig(kind="icub"), ICUB_PLACES)])
def test_channels_are_in_the_order_of_the_layout_by_their_makers_places(board, places):
    theirs, ours = np.array([places[name] for name in board.channels]), positions("parallelogram")[:10]
    theirs, ours = ((place - place.mean(axis=0)) / place.std(axis=0) for place in (theirs, ours))
    assert theirs == pytest.approx(ours, abs=0.01)


@pytest.mark.parametrize("data", [WRONG_CHECK_SUM, NUMBERED])
def test_what_the_makers_library_does_not_take_is_refused(data):
    with pytest.raises(WireError):
        decode(data, WIRE)


@pytest.mark.parametrize(("period", "data"), PERIODS.items())
def test_period_is_set_with_the_makers_bytes(period, data):
    assert encode(Message(HubCommand.PERIOD, encode_period(period, WIRE)), WIRE) == bytes.fromhex(data)
