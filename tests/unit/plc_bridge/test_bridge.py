import pytest
from pydantic import ValidationError

from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.protocol.images import CommandImage, report_image
from plc_bridge.protocol.messages import Command, Control, Refusal, Report, Result
from plc_bridge.protocol.registers import STAGES, Lease
from tests.scan_thread import take


class Time:
    """Monotonic time that stands still until it is moved."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def time():
    return Time()


@pytest.fixture
def bridge(time):
    return Bridge(PlcConfig(), {100: "insert_peg"}, now=time)


def test_command_and_report_go_through(bridge):
    bridge.opened("plc", "plc")
    bridge.wrote("plc", CommandImage(sequence=1))
    bridge.wrote("plc", CommandImage(sequence=2, code=100, recipe=4))
    assert take(bridge) == Command(2, 100, 4, source="plc")
    bridge.publish(Report(sequence=2, state=17, result=Result.SUCCESS, run=9, stage_times=(1.0, 2.5), total_time=3.5))
    image = report_image(bridge.report_words("plc"))
    assert (image.sequence, image.result, image.run, image.holder) == (2, Result.SUCCESS, 9, "plc")
    assert image.stage_times == (1.0, 2.5, *[0.0] * (STAGES - 2))


def test_report_life_counts_with_every_report(bridge):
    bridge.opened("plc", "plc")
    bridge.publish(Report())
    bridge.publish(Report())
    image = bridge.report_for("plc")
    assert (image.life, image.life_tail) == (2, 2)


@pytest.mark.parametrize(
    ("result", "bits"),
    [
        (Result.NONE, [True, False, False, False]),
        (Result.SUCCESS, [False, True, False, False]),
        (Result.FAILURE, [False, False, True, False]),
        (Result.FAULT, [False, False, True, False]),
        (Result.REFUSED, [False, False, True, False]),
        (Result.ABORTED, [False, False, False, True]),
    ],
)
def test_busy_done_error_and_aborted_exclude_each_other(bridge, result, bits):
    bridge.opened("plc", "plc")
    bridge.wrote("plc", CommandImage(sequence=1))
    bridge.wrote("plc", CommandImage(sequence=2, code=100))
    take(bridge)
    bridge.publish(Report(sequence=2, result=result))
    assert bridge.discrete_inputs("plc")[:4] == bits


def test_local_user_holds_the_same_lease(bridge):
    bridge.opened("plc", "plc")
    assert bridge.take("terminal")
    bridge.wrote("plc", CommandImage(sequence=1))
    bridge.wrote("plc", CommandImage(sequence=2, code=100))
    assert bridge.report_for("plc").refusal == Refusal.NOT_HOLDER
    bridge.release("terminal")
    bridge.wrote("plc", CommandImage(sequence=3, code=100))
    assert bridge.poll() == Command(3, 100, source="plc")


def test_local_user_cannot_take_what_a_plc_holds(bridge):
    bridge.opened("plc", "plc")
    bridge.wrote("plc", CommandImage(lease=Lease.TAKE))
    assert not bridge.take("terminal")
    assert bridge.holder == "plc"


def test_local_user_starts_and_is_refused_like_a_plc(bridge):
    bridge.take("terminal")
    assert bridge.submit("terminal", CommandImage(code=100, serial="A")) is Refusal.NONE
    assert bridge.submit("terminal", CommandImage(code=100)) is Refusal.BUSY
    assert bridge.poll() == Command(1, 100, serial="A", source="terminal")


def test_silent_plc_is_lost(bridge, time):
    bridge.opened("plc", "plc")
    bridge.wrote("plc", CommandImage(life=1, sequence=1))
    bridge.wrote("plc", CommandImage(life=2, sequence=2, code=100))
    take(bridge)
    time.now = 1.5
    assert bridge.poll() == Command(2, Control.LOST, source="plc")
    assert bridge.diagnostics.lost == 1


def test_bridge_that_never_started_can_be_closed(bridge):
    bridge.close()
    assert bridge.address == ("127.0.0.1", 5020)


def test_default_listens_on_this_computer_only():
    assert PlcConfig().modbus.host == "127.0.0.1"


@pytest.mark.parametrize(
    "wrong", [{"port": 65536}, {"port": -1}, {"hots": "0.0.0.0"}, {"allow": ["10.0.0.300"]}, {"idle_timeout": 0}]
)
def test_wrong_configuration_is_rejected(wrong):
    with pytest.raises(ValidationError):
        ModbusConfig(**wrong)
